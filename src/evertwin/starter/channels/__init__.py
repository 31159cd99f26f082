"""Which column feeds which channel of a machine."""
