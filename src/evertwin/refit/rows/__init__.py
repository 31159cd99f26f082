"""Which rows count: the machine as it is, levels of long ago, rows with a state, joints at rest."""
