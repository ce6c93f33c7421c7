"""A running graph as others may look at it, such as the studio.

Begin with `view`.
"""
