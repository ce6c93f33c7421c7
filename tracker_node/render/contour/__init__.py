"""Contours of a body in one camera: where they are, how they move, and which are visible.

What is done with them is in `objective.lines` and `objective.chamfer`. Begin with `samples`; `generators` has the closed forms of
cones and ellipsoids (Knossow et al.), `visibility` decides what hides a sample.
"""
