"""A line of a table that summarises many conditions: column -> value."""

from typing import Any

Line = dict[str, Any]
ALL = "all"
"""Value of `scenario` or `method` in a line over all of them."""
