"""Maps of what curves avoid and follow: found on a mesh by itself, and as φ_fea of Eq. 7."""
