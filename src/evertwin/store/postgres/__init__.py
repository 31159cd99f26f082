"""The record that several machines share."""
