"""One twin of the service: its sources, its thread, its rows, what is asked of it."""
