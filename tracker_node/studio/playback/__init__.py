"""The page on which a finished run is looked through.

Begin with `page`.
"""
