"""A simulated TV camera and a simulated range finder that watch a demonstration."""
