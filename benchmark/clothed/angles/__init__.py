"""Joint angles of rendered people, compared with the exact ones. Begin with `angles`."""
