"""From range images to poses: what changed, which part it is, where it stands."""
