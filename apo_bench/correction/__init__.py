"""Correction of an observation by its face contacts. Knows no simulator and never meets the truth."""
