"""The experiments of both papers: Trewartha, Yeadon & Knight (colors), Knossow et al. (contours).

The sub-verbs of `cli.groups.reproduce` run them. Begin with the subpackage of the experiment: `cross`, `somersault`, `contour`.
"""
