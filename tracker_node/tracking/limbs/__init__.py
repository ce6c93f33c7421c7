"""Limbs: what they are in the tree of a body, and whether each is where the state says.

Begin with `tree` (`limbs_of`), then `judge` (the probability that a limb is lost); searches for them are in `region` and `color`.
"""
