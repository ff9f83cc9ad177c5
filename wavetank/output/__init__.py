"""A run directory: its records written and read, its lock, its log, and where it stands."""
