"""Parts from outlines, bores and shafts; lengths in mm."""

from apo_bench.scenario.parts.making.body import Body, join
from apo_bench.scenario.parts.making.extrude import Bore, bore, extrude
from apo_bench.scenario.parts.making.frustums import Frustum
from apo_bench.scenario.parts.making.outline import Edge, Outline, circle, polygon, rectangle, round_corners, slot
from apo_bench.scenario.parts.making.revolve import revolve, shaft
from apo_bench.scenario.parts.making.writing import solid_of, write_part

__all__ = [
    "Body",
    "Bore",
    "Edge",
    "Frustum",
    "Outline",
    "bore",
    "circle",
    "extrude",
    "join",
    "polygon",
    "rectangle",
    "revolve",
    "round_corners",
    "shaft",
    "slot",
    "solid_of",
    "write_part",
]
