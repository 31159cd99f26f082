"""What went on in a run: versions, their changes, steps and spells that passed."""
