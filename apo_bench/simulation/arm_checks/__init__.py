"""What an arm can do, found before it moves: at the table, and along a plan."""
