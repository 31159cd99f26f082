"""Compiled steps, called by address from one fused loop."""
