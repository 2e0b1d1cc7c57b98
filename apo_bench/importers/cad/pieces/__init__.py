"""Cut solids into convex pieces, [mm]."""
