"""A trail from a GPS track with noise."""

import sys

import numpy as np
from scipy.spatial import cKDTree

import nicmm_core as nicmm
from docs.gallery import models

path = sys.argv[1]

mesh = models.terrain()
t = np.linspace(-0.85, 0.85, 160)
track = np.stack([t, 0.4 * np.sin(3.5 * t), 0.0 * t], axis=1)
track += np.random.default_rng(1).normal(scale=0.008, size=track.shape)
on_map = cKDTree(mesh.vertices[:, :2])
track = mesh.vertices[on_map.query(track[:, :2])[1]]
points = nicmm.fit_stroke(mesh, track, tolerance=0.03)
trail = nicmm.design_curve(mesh, points, closed=False)
nicmm.plot(mesh, trail, path, view=(0.2, -1.0, 0.7), up=(0, 0, 1))
