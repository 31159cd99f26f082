"""The machines, and what they sense."""
