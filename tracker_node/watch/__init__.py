"""Bodies, cameras and images in Rerun's viewer: of runs in files, and of a running graph.

Layouts of viewers that take topics as they are, Foxglove among them, are in `loaders.layouts`. Begin with `view`.
"""
