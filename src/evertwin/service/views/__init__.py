"""What is shown of a running twin beside its newest row: its past, two versions, what it tunes."""
