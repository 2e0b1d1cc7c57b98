"""Correctors that were trained: networks small enough for NumPy, with weights that come along."""
