"""A plan carried out by the robot."""
