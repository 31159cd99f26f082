"""Machines, recordings and lives whose truth is known, and figures that hold an answer against it.

Tests, proofs and benchmarks share them; the wheel has none of them.
"""
