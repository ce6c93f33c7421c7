"""Slow, obvious or closed-form versions to compare with."""
