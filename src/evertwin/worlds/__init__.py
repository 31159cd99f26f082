"""Embedded machines that stand for the real ones, in processes of their own.

``python -m evertwin.worlds.robot`` and ``python -m evertwin.worlds.arm`` write recordings; a twin
sees those and never the truth behind them. They know `evertwin.signals` and `evertwin.sources` at
most, and are launched by `evertwin.app` alone.
"""
