"""The page of a finished run: its images, overlays and curves.

Begin with `page`.
"""
