"""Many twins in one process, each beside its machine: sources, HTTP, publishers, reload."""
