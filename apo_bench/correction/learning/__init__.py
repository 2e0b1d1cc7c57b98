"""What contacts tell of the noise of a camera, without the truth."""
