"""How far the tracker's own word can be trusted: covariances and statuses against truth."""
