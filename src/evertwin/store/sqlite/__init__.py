"""The record in a file: its lock, its archive of older days, and what is saved of a damaged one."""
