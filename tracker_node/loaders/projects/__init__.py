"""Folders of other programs' projects: which videos and which calibration belong together.

What a calibration says is read in `loaders.rig`. Begin with `programs`.
"""
