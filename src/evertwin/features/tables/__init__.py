"""Tables that scans show."""
