"""Removes from a surface what is too close to other curves, and checks curves against them.

Like obstacles, curves to avoid are removed before anything is solved, so every stage respects them.
What is removed ends at edges of the surface that remains.

A control point on an avoided curve is a junction. Around it the barrier has a gap, through which
the curve can pass, and the clearance does not count within `FADE` clearances along the curve.
"""
