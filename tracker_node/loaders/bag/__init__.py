"""Bags of rosbag2 with MCAP storage, read and written without ROS.

Begin with `reader` and `writer`; what the messages of a run are is in `runs.messages`.
"""
