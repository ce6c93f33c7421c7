"""Silhouettes of a tracked body compared with reference masks.

Begin with `silhouettes`.
"""
