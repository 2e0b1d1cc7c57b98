"""Files of triangles become closed meshes of solids, [mm]."""
