"""An ornament on a vase: a wave and its offsets."""

import sys

import numpy as np

import nicmm_core as nicmm
from docs.gallery import models

path = sys.argv[1]

mesh = models.vase()
angle = np.radians(np.arange(0, 360, 30))
height = 0.75 + 0.12 * np.where(np.arange(12) % 2, 1.0, -1.0)
places = np.stack([0.45 * np.cos(angle), 0.45 * np.sin(angle), height], axis=1)
designer = nicmm.Designer(mesh)
wave = designer.design(models.nearest(mesh, places))
offsets = designer.offset_curves(wave, [0.04, 0.08, -0.04, -0.08])
curves = [wave, *(curve for side in offsets for curve in side)]
nicmm.plot(mesh, curves, path, view=(0.3, -1.0, 0.25), up=(0, 0, 1))
