"""Contact states with rotation: the same linear programme for screws, and what turning adds to translation."""

from typing import NamedTuple

import numpy as np

from apo_bench.geometry.arrays import Array
from apo_bench.insertion.states import State, classify

_LENGTH_M = 0.04
"""Turns are counted by how far they move a point at this distance, so that rows have one unit."""


class Screw(NamedTuple):
    """The state of a part that may also turn."""

    all: State
    """The state in all six degrees of freedom."""
    translation: State
    rotation: State
    """What is left of `all` when translation is taken out."""


def screw_state(points: Array, normals: Array) -> Screw:
    """The state of a part that is touched at points.

    Args:
        points: Corners of the contacts, (k, 3), [m], any frame.
        normals: From what rests into the free side of what moves, (k, 3), one for each point.
    """
    everything = classify(_screw_rows(points, normals)).state
    translation = classify(np.unique(normals, axis=0)).state
    m = everything.maintaining - translation.maintaining
    c = everything.constraining - translation.constraining
    return Screw(everything, translation, State(m, 3 - m - c, c))


def _screw_rows(points: Array, normals: Array) -> Array:
    """One row (p x n / L, n) per point, (k, 6): how fast a twist (L w, v) about the middle opens it."""
    arms = points - points.mean(axis=0) if len(points) else points
    return np.hstack([np.cross(arms, normals) / _LENGTH_M, normals])
