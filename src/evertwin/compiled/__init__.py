"""Arithmetic that is written once in plain Python and run as machine code where that pays.

`functions` holds the decorators, `calls` and `memory` what such a function may do besides
arithmetic: call a C function by its address, read what lies behind one. Each has a plain form here
and one for Numba in `intrinsics`.
"""
