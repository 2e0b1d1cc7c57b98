"""Import CAD files as parts: fit the faces of each solid and cut the solid into convex pieces; lengths in mm."""
