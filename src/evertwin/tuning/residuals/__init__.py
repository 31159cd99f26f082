"""What residuals still say: their memory, and how they hang on inputs."""
