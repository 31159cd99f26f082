"""What a detector sees in images, and what it takes for what."""
