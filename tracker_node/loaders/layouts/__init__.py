"""Layouts of RViz, Foxglove and PlotJuggler for a tracker's topics.

Begin with `viewed_graph`: which topics they show.
"""
