"""Detection of face contacts from observed poses."""
