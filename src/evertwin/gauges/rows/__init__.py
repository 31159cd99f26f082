"""Rows that hypotheses about a gauge are tested on, how they may have been read, and its words."""
