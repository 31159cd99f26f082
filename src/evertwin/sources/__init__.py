"""Recorded files in, chunks of one source out."""
