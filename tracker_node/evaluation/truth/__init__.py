"""Truth that a run is compared with: joints, states, and which time of it belongs to which image set.

Begin with `files` and `association`.
"""
