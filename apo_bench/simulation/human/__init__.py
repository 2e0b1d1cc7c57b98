"""Simulate the human who demonstrates: two hands that carry out each operation."""
