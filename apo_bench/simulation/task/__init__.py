"""One operation under the control of an agent."""
