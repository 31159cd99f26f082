"""From samples to rows: one clock, what was computed from channels, what was lost."""
