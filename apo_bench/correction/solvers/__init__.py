"""Solvers of the contact equations."""
