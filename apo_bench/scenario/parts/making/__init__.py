"""Build parts from outlines, bores and shafts, and write them as part files; lengths in mm."""

from apo_bench.scenario.parts.making.body import Body, join
from apo_bench.scenario.parts.making.extrude import Bore, bore, extrude
from apo_bench.scenario.parts.making.frustums import Frustum
from apo_bench.scenario.parts.making.outline import (
    Edge,
    Outline,
    make_circle,
    make_polygon,
    make_rectangle,
    make_slot,
    round_corners,
)
from apo_bench.scenario.parts.making.revolve import make_shaft, revolve
from apo_bench.scenario.parts.making.writing import build_solid, write_part

__all__ = [
    "Body",
    "Bore",
    "Edge",
    "Frustum",
    "Outline",
    "bore",
    "build_solid",
    "extrude",
    "join",
    "make_circle",
    "make_polygon",
    "make_rectangle",
    "make_shaft",
    "make_slot",
    "revolve",
    "round_corners",
    "write_part",
]
