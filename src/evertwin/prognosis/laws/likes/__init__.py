"""What like machines tell, and whether a machine wears as they do."""
