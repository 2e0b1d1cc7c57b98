"""States with round and tilted faces that were moved after they were put, written down as in `audited_wholes`."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from apo_bench.assembly import Operation
from apo_bench.scenario.parts import load_part
from tests.audited_rounds import DOWN
from tests.audited_states import Seen
from tests.end_states import END, moved, shift
from tests.rounds import countersink, dovetail, in_groove, nested, peg, peg_in_plate, plate, through, wedges_meet
from tests.scenes import Scene, block, mm, scene, table, touch


def of_parts(names: dict[str, str], *operations: Operation, at: list[np.ndarray]) -> Scene:
    """Parts of the package, by their names here."""
    parts = [replace(load_part(file), name=name) for name, file in names.items()]
    return scene([table(), *parts], operations, at)


def sunk_slide() -> Scene:
    """A slide in a dovetail whose floor and walls recede."""
    return of_parts(
        {"base": "dovetail_base", "slide": "dovetail_slide"},
        Operation("base", touch("base", "table", "bottom-top")),
        Operation("slide", touch("slide", "base", "bottom-floor", "lean_n-slot_n", "lean_p-slot_p")),
        at=[mm(0, 0, 0), mm(0, 0, 10)],
    )


def wedge_under_roof() -> Scene:
    """A wedge on the floor, at the wall and under the leaning roof of one part."""
    return of_parts(
        {"roof": "lean_to", "wedge": "wedge"},
        Operation("roof", touch("roof", "table", "bottom-top")),
        Operation("wedge", touch("wedge", "roof", "bottom-floor", "side_p-wall", "slope-under")),
        at=[mm(0, 0, 0), mm(0, 5, 10)],
    )


def fixed(built: Scene, *parts: str) -> Scene:
    """The same with parts that are fixed where they would have been put, by the first operations."""
    n = len(parts)
    assembly = built.assembly
    assert {operation.main for operation in assembly.operations[:n]} == set(parts)
    start = {**built.start, **dict(zip(parts, built.nominal_poses[:n], strict=True))}
    rest = replace(assembly, operations=assembly.operations[n:], fixed=assembly.fixed | set(parts))
    return Scene(rest, start, built.nominal_poses[n:])


def peg_in_fixed() -> Scene:
    """A peg of 8 mm stands in a hole of 10 mm that is fixed: 1 mm of play by their sizes."""
    built = peg_in_plate()
    solids = [table(), plate(fit=False), peg(radius=4.0)]
    return fixed(scene(solids, built.assembly.operations, list(built.nominal_poses)), "plate")


def fixed_groove() -> Scene:
    """A shaft in a groove that is fixed."""
    return fixed(in_groove(), "v")


def at_fence() -> Scene:
    """A block on the table, against another one that is fixed."""
    operations = [
        Operation("fence", touch("fence", "table", "nz-top")),
        Operation("A", touch("A", "table", "nz-top") + touch("A", "fence", "px-nx")),
    ]
    return fixed(scene([table(), block("fence"), block("A")], operations, [mm(50, 0, 25), mm(0, 0, 25)]), "fence")


PEGS = [
    Seen("peg, pulled up by 1.2 mm at the end", peg_in_plate, [shift("peg", END, 0, 0, 1.2)], False),
    Seen(
        "peg, from one side of its play to the other at the end",
        peg_in_plate,
        [shift("peg", 2, -0.3, 0, 0), shift("peg", END, 0.6, 0, 0)],
        True,
    ),
    Seen(
        "peg, leans by 0.9 degrees one way, and the other way at the end",
        peg_in_plate,
        [shift("peg", 2, 0, 0, 0, (0.9, 0, 0)), shift("peg", END, 0, 0, 0, (-1.8, 0, 0))],
        True,
    ),
    Seen("bush, the plate alone nudged by 0.3 mm at the end", nested, [shift("plate", END, 0.3, 0, 0)], True),
    Seen("bush, the plate alone nudged by 0.4 mm at the end", nested, [shift("plate", END, 0.4, 0, 0)], False),
    Seen(
        "peg in a fixed hole, pushed by 1.5 mm from one side of its play to the other",
        peg_in_fixed,
        [shift("peg", 1, -0.75, 0, 0), shift("peg", END, 1.5, 0, 0)],
        True,
    ),
]
"""Pegs in holes, nudged and turned."""

SHAFTS = [
    Seen("shaft, slid by 1.5 mm along its bores at the end", through, [shift("peg", END, 0, 0, 1.5)], False),
    Seen("shaft, slid by 0.8 mm along its bores at the end", through, [shift("peg", END, 0, 0, 0.8)], True),
    Seen(
        "fixed groove, the shaft slid by 1.5 mm along it at the end",
        fixed_groove,
        [shift("peg", END, 0, 0, 1.5)],
        False,
    ),
    Seen("fence, the block slid by 1.5 mm along it at the end", at_fence, [shift("A", END, 0, 1.5, 0)], False),
    Seen("fence, the block slid by 0.8 mm along it at the end", at_fence, [shift("A", END, 0, 0.8, 0)], True),
    Seen("fence, the block 0.3 mm off it", at_fence, [shift("A", END, -0.3, 0, 0)], False),
]
"""Shafts that lie and shafts in bores, nudged and turned."""

CONES = [
    Seen("plug, turned by 100 degrees at the end", countersink, [shift("plug", END, 0, 0, 0, (0, 0, 100))], True),
    Seen("plug, 0.3 mm high at the end", countersink, [shift("plug", END, 0, 0, 0.3)], False),
]
"""Cones, nudged and turned."""

TILTED = [
    Seen(
        "wedges, the upper one slid by 1.5 mm down the slope",
        wedges_meet,
        [moved(END, mm(*(1.5 * DOWN)), "high")],
        False,
    ),
    Seen("dovetail, the slider slid by 1.5 mm along at the end", dovetail, [shift("slider", END, 1.5, 0, 0)], False),
    Seen("slide, sunk by 0.25 mm and 0.56 mm aside, in a wall", sunk_slide, [shift("slide", 2, 0, 0.56, -0.25)], False),
    Seen("wedge, 0.4 mm off the wall", wedge_under_roof, [shift("wedge", 2, 0, -0.4, 0)], False),
]
"""Faces that are neither level nor upright, nudged, turned and in their play."""

STATES = [*PEGS, *SHAFTS, *CONES, *TILTED]

DIFFERS = {
    "peg in a fixed hole, pushed by 1.5 mm from one side of its play to the other": (
        "a mate of a fixed part says where a part belongs, so all motion in it counts, that within its play too"
    )
}
"""States of which the rule says otherwise than the person, and what in the rule does."""
