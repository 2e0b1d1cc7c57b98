"""Read files of triangles as closed meshes of solids, [mm]."""
