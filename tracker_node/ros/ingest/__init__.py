"""Cameras of all kinds as ROS cameras, and images without distortion.

Begin with `node`; `live_camera` has the sources that are not files.
"""
