"""Text tables in the dialects that people and programs write."""
