"""Is it the sensor or the machine: each measurement is judged before it counts."""
