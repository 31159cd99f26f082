"""Columns of time: dates, stamps, units, and a guard over what goes backward."""
