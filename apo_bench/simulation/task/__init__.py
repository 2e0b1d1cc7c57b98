"""One insertion under the control of an agent: the start of an episode, and the tip control between actions."""
