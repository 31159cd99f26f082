"""A channel in another unit, of another sign, counted from elsewhere, or in another's column."""
