"""What an answer can be beside a plain fit: a cause, a state, an earlier version, a correction."""
