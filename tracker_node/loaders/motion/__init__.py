"""Motions over time as files: our CSV tables, TRC, C3D, BVH, OpenSim's tables, TUM.

Begin with `trajectory_file`, the tables that runs leave.
"""
