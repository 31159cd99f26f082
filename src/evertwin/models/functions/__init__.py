"""Models from a plain Python function, compiled where that is arithmetic."""
