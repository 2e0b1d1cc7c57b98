"""A file becomes a checked scenario; where a seed puts it, and how a human errs."""
