"""From a breakdown file to a twin file."""
