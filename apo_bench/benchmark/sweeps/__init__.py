"""Many trials: which there are, who runs them, where their rows go."""
