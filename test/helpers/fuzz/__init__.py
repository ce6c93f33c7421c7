"""Damaged files, and how they are answered."""
