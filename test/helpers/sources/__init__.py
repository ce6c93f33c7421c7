"""Cameras, servers, disks and files that misbehave as told."""
