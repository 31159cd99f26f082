"""evertwin keeps the model of a machine true to the machine."""
