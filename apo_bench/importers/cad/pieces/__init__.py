"""Solids are cut into convex pieces, [mm]."""
