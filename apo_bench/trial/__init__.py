"""One trial: its stages, its row, its fingerprint."""
