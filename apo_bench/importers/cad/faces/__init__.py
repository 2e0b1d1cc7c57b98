"""Faces of a mesh: planes, cylinders and cones are fitted to its triangles, [mm]."""
