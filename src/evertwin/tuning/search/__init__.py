"""Where outputs bend with the parameters: least squares by steps, from several places."""
