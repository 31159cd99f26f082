"""A channel that is off by a constant or a share, at once or ever more."""
