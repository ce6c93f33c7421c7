"""Bags played into topics, and topics recorded into bags.

Begin with `player` and `recorder`; the files themselves are written in `loaders.bag`.
"""
