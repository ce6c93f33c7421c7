"""Bags of rosbag2 with MCAP storage, read and written without ROS.

Begin with `reader` and `writer`; single files are written by `mcap_writer`, and read by `mcap_recovery` whatever their condition.
What the messages of a run are is in `runs.messages`.
"""
