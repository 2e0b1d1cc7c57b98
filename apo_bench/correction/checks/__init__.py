"""Checks of any correction: whether it is executable, how it ended, and whether the stated noise explains it."""
