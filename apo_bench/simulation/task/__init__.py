"""One operation under the control of an agent: where it starts, the arm between two actions, and how it ends."""
