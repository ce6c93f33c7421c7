"""Rotations, rigid transforms and quaternions as functions of arrays.

Nothing here knows of cameras or bodies. Begin with `se3`: every pose in this package is one of its 4x4 matrices.
"""
