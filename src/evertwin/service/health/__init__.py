"""How a twin is: its condition by NAMUR NE 107, its deviation now, its sensors' faults."""
