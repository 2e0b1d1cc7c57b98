"""What was run, how its trials ended, and which of its failures are drawn."""
