"""Observations of a demonstration: noise models, reobservations, and wrong contacts."""
