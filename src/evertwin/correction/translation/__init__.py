"""From what was commanded to what the machine does: a table that is learned, and its law."""
