"""Examples: what the literature reports, recomputed."""
