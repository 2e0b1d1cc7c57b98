"""Descendants of a body, and extents of geoms, in a compiled model."""

from typing import Any

import numpy as np

from apo_bench.geometry import Array


def below(model: Any, body: int) -> set[int]:
    """A body and all its descendants."""
    hanging = {body}
    for b in range(body + 1, model.nbody):
        if int(model.body_parentid[b]) in hanging:
            hanging.add(b)
    return hanging


def geom_reach(model: Any, data: Any, geom: int, ahead: Array) -> float:
    """The largest coordinate of a geom's bounding box along a world direction, [m]."""
    along = data.geom_xmat[geom].reshape(3, 3).T @ ahead
    centre = model.geom_aabb[geom, :3]
    half = model.geom_aabb[geom, 3:]
    return float(data.geom_xpos[geom] @ ahead + centre @ along + half @ np.abs(along))
