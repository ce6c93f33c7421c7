"""Motions of synthetic subjects: captured clips, procedural ones, and several joined.

Begin with `motion`, the representation of all of them.
"""
