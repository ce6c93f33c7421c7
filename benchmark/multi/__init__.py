"""Several bodies at once: a real clip of two people."""
