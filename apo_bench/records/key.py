"""What tells one trial of a sweep from another."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

Key = tuple[str, float, int, float, float, float, str, str, str, str]
"""What tells one trial of a sweep from another: the columns `KEY` of its row."""
KEY = (
    *("scenario", "clearance_mm", "seed", "careless", "level", "level_deg"),
    *("noise", "relations", "grasp", "method"),
)


def row_key(row: Mapping[str, Any]) -> Key:
    """The key of the trial that a row is of."""
    return (
        *(row["scenario"], row["clearance_mm"], row["seed"], row["careless"], row["level"]),
        *(row["level_deg"], row["noise"], row["relations"], row["grasp"], row["method"]),
    )
