"""Human bodies: measures, segments, masses, and the models made of them.

Bodies of other kinds come from files (`loaders.model`). Begin with `human`: the body that tracks by default, the fuller one with
hands and feet of `extremities`. `segments18` is the body of the color paper.
"""
