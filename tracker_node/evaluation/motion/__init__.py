"""Motions of a run for other programs and people: coordinates, joint angles, derivatives, exports.

Begin with `coordinates` and `export`; file formats are in `loaders.motion`.
"""
