"""Two clothed people who pass each other, embrace and part: how they move, and how that is drawn.

Begin with `_stage`; people, clothes, room and renderer are those of `benchmark/clothed`.
"""
