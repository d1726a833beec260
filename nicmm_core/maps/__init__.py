"""Obstacle and alignment maps: weights computed from a mesh, and φ_fea of Eq. 7."""
