"""A simulated TV camera and a simulated range finder that record a demonstration."""
