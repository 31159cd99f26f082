"""What the twin decides at a beat, one concept each."""
