"""One score for a method: tracks of fixed trials, an entry in a file, a table of entries."""
