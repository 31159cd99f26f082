"""Machines that nobody tuned for: each looks like a textbook machine and has one effect more.

Plain files, a scorer, and how three ways to predict fare on them; README.md tells the format.
"""
