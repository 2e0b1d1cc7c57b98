"""Checks of any correction: is it executable, how did it end, and does the stated noise explain it."""
