"""What is open when a run ends: trials, faults, what was not judged, and why nothing is better."""
