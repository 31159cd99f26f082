"""Arrays that a file or a program holds whole."""
