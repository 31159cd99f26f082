"""Correction terms: one file for each kind, and the contract that everything else knows alone."""
