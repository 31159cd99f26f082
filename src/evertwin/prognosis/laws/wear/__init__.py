"""Laws of wear as hypotheses, weighed by the data, and what they are worth told alone."""
