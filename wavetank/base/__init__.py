"""Values of a case: validated types with ranges, formulae, files."""
