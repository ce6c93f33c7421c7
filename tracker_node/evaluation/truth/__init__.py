"""Truth that a run is compared with: joints, states, and which instant belongs to which image set.

Begin with `joints` and `association`.
"""
