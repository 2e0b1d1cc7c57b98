"""Poses from range images, measured in place of drawn."""
