"""STEP files become solids whose faces have the parameters of the file, [mm]."""
