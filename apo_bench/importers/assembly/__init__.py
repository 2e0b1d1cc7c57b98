"""Parts and their final poses become a scenario file, and a scenario is checked from end to end."""
