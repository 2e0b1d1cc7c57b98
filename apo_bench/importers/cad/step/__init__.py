"""Read STEP files as solids whose faces have the exact parameters of the file, [mm]."""
