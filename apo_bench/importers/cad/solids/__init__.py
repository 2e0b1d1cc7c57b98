"""Solids as a CAD file holds them: closed meshes whose faces have parameters and names, [mm]."""
