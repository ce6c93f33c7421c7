"""Drills: faults injected into a running graph, and damaged files."""
