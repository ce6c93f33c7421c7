"""Python functions for whole recordings and runs: track, compare with truth, export, tables of pandas and xarray.

`tracker_node` itself offers these names, imported when they are first used. The algorithms are in the packages below, and
nothing of ROS is here. Begin with `functions`, then `run`.
"""
