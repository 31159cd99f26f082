"""From lives to dates: what maintenance costs when, which stops are shared, and alarms."""
