"""The page that leads from a folder of videos to a report, in seven steps that are commands of the program.

What the pages of the studio show of the results lives beside. Begin with `page`, then `steps`.
"""
