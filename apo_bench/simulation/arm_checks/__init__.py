"""Check an arm before it moves: at the table of a scenario, and along a plan."""
