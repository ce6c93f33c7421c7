"""A run: its image sets, the loop over them, its messages, the folder that it leaves, and reading that again.

No ROS here: the live node and the offline run share `loop` (images to image sets, these to estimates),
`messages` and `outputs` (what is said of an estimate, on which topics). Begin with `offline`, the tracker on recorded images;
`image_sets` is where they come from, `load` reads what a run left.
"""
