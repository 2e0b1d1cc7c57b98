"""One trial: its stages from demonstration to verdict, its record, and the hash that identifies the record."""
