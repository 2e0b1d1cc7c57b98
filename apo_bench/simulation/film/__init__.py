"""Films and viewers of a trial that was recorded moment by moment."""
