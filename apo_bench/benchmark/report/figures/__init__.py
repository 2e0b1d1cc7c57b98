"""Figures of a sweep: rows in, pictures out."""
