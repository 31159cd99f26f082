"""The commands that look ahead: forecast, life, whatif, setpoint, plan, decide."""
