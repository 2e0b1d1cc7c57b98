"""CAD files become parts: solids with fitted faces, then convex pieces; lengths in mm until a part is written."""
