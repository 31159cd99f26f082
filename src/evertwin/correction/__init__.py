"""Structural correction: terms that make the model do what the machine does."""
