"""The report of one or many runs: what of a review becomes which table, chart or picture.

Begin with `builder`; pages and PDFs in general are made by the package `report`.
"""
