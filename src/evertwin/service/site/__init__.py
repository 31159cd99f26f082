"""A site file and what it comes to."""
