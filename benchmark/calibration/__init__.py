"""Cameras, clocks and the doctor."""
