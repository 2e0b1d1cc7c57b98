"""Pictures and words about one plan, one part, one noise model."""
