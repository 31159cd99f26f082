"""Lives of a machine's components and what follows: work ahead, alarms, plans, scenarios."""
