"""Like machines: which histories and stores are theirs, and whether they are of one type."""
