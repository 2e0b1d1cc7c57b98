"""Pages that a browser opens without a network: HTML, style, script and drawings in one file."""
