"""Image sets, and what each camera's images say before a body is fitted: colors, masks, distance maps, background.

Comparing them with a body in a state is the matter of `objective`. Begin with `image_set` and `synchronizer`, then `appearance`.
"""
