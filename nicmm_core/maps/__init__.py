"""Maps of obstacles and alignment: weights from a mesh, and φ_fea of Eq. 7."""
