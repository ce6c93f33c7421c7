"""Verbs that are made of others, ``tracker_node <verb> <what>``, which their modules list as ``SUBVERBS``.

Begin with `rig`.
"""
