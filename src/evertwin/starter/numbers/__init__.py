"""What the numbers of recordings say, roughly: where a model starts, and how far it reaches."""
