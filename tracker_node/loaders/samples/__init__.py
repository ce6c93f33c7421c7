"""Sample recordings for a first run, fetched from the package index.

Begin with `data`.
"""
