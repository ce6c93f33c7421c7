"""How bodies move: prediction before a fit, correction by it, and smoothing afterwards.

Begin with `model` (the filter that trackers use), then `dynamics` (the process itself); `smoother` works on recordings.
"""
