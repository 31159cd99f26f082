"""What makes simulated and measured data comparable: features of raw sensor data.

Scan to pose: `ScanMatcher` follows a lidar against a local map, `mapped` closes its loops,
`Occupancy` keeps the map, and `located` finds a scan in it.
"""
