"""The commands of stores: verify, backup, restore, export, recover; events."""
