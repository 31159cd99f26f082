"""Training of the detector that `evertwin detect` runs; torch is needed here alone."""
