"""Import the pose log of a tracker as an observation: read it, find rests of parts, and match them to operations."""
