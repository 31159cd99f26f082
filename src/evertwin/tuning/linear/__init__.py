"""Outputs that are linear in the tuned parameters: sums over rows, then one small system."""
