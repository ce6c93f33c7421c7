"""Verbs that are ROS nodes, the pipeline of them, and the layouts that they are watched with.

Begin with `tracker`.
"""
