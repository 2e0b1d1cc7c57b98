"""Rates, paired comparisons, curves, power: numbers out of rows."""
