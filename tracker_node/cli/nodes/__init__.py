"""Verbs that are ROS nodes, and the pipeline of them.

Begin with `tracker`.
"""
