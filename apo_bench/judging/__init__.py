"""The judge: decides from geometry and the reached poses alone whether an assembly is right."""
