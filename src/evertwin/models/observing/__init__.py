"""States that nothing measures, estimated where predictions start again."""
