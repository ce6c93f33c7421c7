"""The page on which points are clicked on in the images, and what comes of the clicks.

Begin with `page`; `click_store` keeps the clicks.
"""
