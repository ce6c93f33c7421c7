"""Pages of the documentation, read and walked through."""
