"""A run: its image sets, the loop over them, its messages, the folder that it leaves, and reading that again.

No ROS here: the live node and the offline run share it. Begin with `offline` (the tracker on recorded images), `image_sets`
(where they come from) and `data` (what a run left).
"""
