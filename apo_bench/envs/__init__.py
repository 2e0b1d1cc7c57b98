"""The environments for Gymnasium."""
