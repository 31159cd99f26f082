"""Embedded machines as processes of their own, and the demonstrations that run beside them."""
