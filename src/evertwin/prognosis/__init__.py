"""From the history of parameters to remaining useful life, alarms and a maintenance plan."""
