"""Accuracy and speed by colors."""
