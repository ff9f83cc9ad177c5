"""A run directory: writing and reading of records, lock, log, and status."""
