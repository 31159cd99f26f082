"""What recordings show: their headings in the field's words, and what columns say of each other."""
