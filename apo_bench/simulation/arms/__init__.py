"""Arms that a file describes."""
