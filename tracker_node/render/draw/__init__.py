"""Pictures of a tracked body for people: overlays, masked images, colors of states.

Charts and pages are in `report`. Begin with `overlay`.
"""
