"""Arms that are described by a file: read, built from their MJCF, their grippers measured, their limits kept."""
