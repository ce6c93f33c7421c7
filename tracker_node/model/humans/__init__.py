"""Human bodies: measures, segments, and the models made of them.

Bodies of other kinds come from files (`loaders.model`). Begin with `human`, the body that tracks by default; `segments18` is the
body of the color paper, `surfaces18` its two surfaces.
"""
