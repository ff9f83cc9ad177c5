"""What the nouns of a case are made of: validated values with their ranges, formulae, files."""
