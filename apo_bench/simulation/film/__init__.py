"""Films and viewers of a trial that was kept moment by moment."""
