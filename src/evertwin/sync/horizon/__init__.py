"""Predictions over a horizon, each from the measured state."""
