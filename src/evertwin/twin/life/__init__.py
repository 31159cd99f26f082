"""How long components last, from the parameter history; maintenance, and the work ahead."""
