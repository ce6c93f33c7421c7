"""Tracking by silhouettes and edges with the chamfer distance (Knossow et al.).

Begin with `modality`; `judge` tells how far its estimates can be trusted.
"""
