"""Which process may write of a twin."""
