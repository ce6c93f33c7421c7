"""The page that shows a running graph.

Begin with `page`; the graph itself is read in `ros.live_view`.
"""
