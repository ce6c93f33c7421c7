"""Markerless model-based 3D motion tracking for ROS 2."""

__version__ = "0.1.0"
