"""Synthetic recordings with exact truth: subjects, motions, scenes.

Their renderer is not the tracker's, so that truth is independent. Begin with `recording`, what can
be asked for, and `dataset`, which records.
"""
