"""Machines: equations, parameters with bounds, reference. One file or room per machine."""
