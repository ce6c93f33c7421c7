"""Cameras and points from pixels of points: triangulation, bundle adjustment, direct linear transformation.

Begin with `triangulation` and `dlt`; `rig_refinement` places cameras by the joints of whoever was in the room.
"""
