"""Cameras of all kinds as ROS cameras, and images without distortion.

Begin with `node`; `live_camera` and `topic_source` are the sources that are not files.
"""
