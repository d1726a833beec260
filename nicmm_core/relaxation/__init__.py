"""The curve itself comes to rest on the input mesh.

`relaxing` is the way in; `warm_start` goes on from a curve that has been there.
"""
