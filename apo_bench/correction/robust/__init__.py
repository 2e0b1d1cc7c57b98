"""Correction when some observations are grossly wrong, or missing."""
