"""Parameters that follow a machine row by row."""
