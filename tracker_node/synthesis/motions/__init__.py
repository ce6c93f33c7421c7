"""Motions of synthetic subjects: captured clips, procedural ones, and several joined.

Begin with `procedural`, the representation of all of them.
"""
