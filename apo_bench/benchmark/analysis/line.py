"""A line of a table that is counted over many conditions: column -> value."""

from typing import Any

Line = dict[str, Any]
ALL = "all"
"""Stands for every scenario, or every method."""
