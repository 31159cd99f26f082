"""How machines speak: a protocol each, behind a cable."""
