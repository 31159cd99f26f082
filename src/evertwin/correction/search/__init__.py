"""Which terms pay: each is tried, and judged on what was held out."""
