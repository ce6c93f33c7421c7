"""Synthetic recordings with exact truth: subjects, motions, scenes.

Their renderer is not the tracker's, so that truth is independent. Begin with `dataset`, which records, and `sequences`, what
can be recorded.
"""
