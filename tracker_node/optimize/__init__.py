"""Optimizers over states of a body: by derivatives, by scores alone, from far away.

They know objectives by protocol only. Begin with `levenberg_marquardt` and `stepping` (the V-algorithm of Trewartha et al.);
`robust_fit` searches wider where a fit is not the body.
"""
