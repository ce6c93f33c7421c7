"""Covariances of fits, and what the images cannot tell.

Begin with `covariance` (from normal equations to a covariance), which also names degrees of freedom that nobody sees.
"""
