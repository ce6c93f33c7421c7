"""Runs of the recorder, for `benchmark/ros/recording.py`."""
