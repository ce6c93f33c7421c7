"""Shapes of body parts, each in its own frame, meters.

How shapes are drawn, and where their contours are, is in `render`. Begin with `primitives`; `capsules` are what collisions see of
every shape.
"""
