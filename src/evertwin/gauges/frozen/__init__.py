"""A channel that stays where it is."""
