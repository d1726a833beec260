"""The cuff of a glove, and rings at the fingers."""

import sys

import numpy as np

import nicmm_core as nicmm
from docs.gallery import models

path = sys.argv[1]

mesh = models.hand()
designer = nicmm.Designer(mesh)


def ring(centre, radius):
    angle = np.radians([0, 120, 240])
    return np.asarray(centre) + radius * np.stack(
        [np.cos(angle), np.sin(angle), 0.0 * angle], axis=1
    )


curves = [designer.design(models.nearest(mesh, ring((0, 0, -0.15), 0.16)))]
for x in (-0.29, -0.1, 0.1, 0.29):
    curves.append(designer.design(models.nearest(mesh, ring((x, 0, 0.68), 0.06))))
nicmm.plot(mesh, curves, path, view=(0.3, -1.0, 0.3), up=(0, 0, 1))
