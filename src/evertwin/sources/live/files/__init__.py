"""Files that grow, and recordings that are replayed as if live."""
