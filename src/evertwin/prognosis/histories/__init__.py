"""Histories: as people write them and as the store keeps them, one series of values each."""
