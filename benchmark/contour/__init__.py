"""Accuracy and speed by contours: figures, boxes, mannequins, the Balancing clip."""
