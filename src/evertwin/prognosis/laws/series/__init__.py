"""Series in, lives out: what they hold, and how values are read before any law is asked."""
