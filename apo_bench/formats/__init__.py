"""Read and write the file formats of observations, plans, pose estimates and robot frames."""
