"""The record in tables of a database, whichever it is."""
