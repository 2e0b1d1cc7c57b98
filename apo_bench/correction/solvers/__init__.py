"""Solvers of the contact equations, and by how much play lets these equations be off."""
