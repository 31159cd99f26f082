"""Channels that come late, and stamps in another unit of time."""
