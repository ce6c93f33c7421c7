"""The check of a rig from a few seconds of its images: what is wrong with cameras, clocks, videos.

Begin with `diagnosis`, which asks the others; `setup.Finding` is what each of them returns.
"""
