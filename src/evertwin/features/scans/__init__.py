"""Poses from scans while they come, with what wheels and gyro say."""
