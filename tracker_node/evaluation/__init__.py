"""A run compared with truth, and with itself: metrics, consistency, tables and pages.

How runs are made and read is in `runs`; documents in general are in `report`. Begin with `evaluate`, then `review` and
`report.builder`; `metrics` has the pure functions.
"""
