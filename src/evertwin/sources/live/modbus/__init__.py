"""Modbus TCP: registers that are read, never written."""
