"""What is perceived of a demonstration: observed poses, detected contacts, depth images."""
