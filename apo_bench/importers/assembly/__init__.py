"""Assembly import: turn parts at their final poses into a scenario file, and check a scenario file from end to end."""
