"""States to audit the judge with: what a person sees, and whether that person says that the assembly is right.

The verdicts were written down before the judge was asked. The person knows what was to be built and which parts are
alike, has seen no replay, and can measure what the thresholds ask for.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from apo_bench.assembly import Operation
from tests import scenes
from tests.end_states import (
    ALIGNED,
    BRIDGE,
    CARRIED,
    CASTLES,
    END,
    FIXTURE,
    POCKETS,
    TOWER,
    Edit,
    moved,
    never,
    put,
    shift,
    state,
)
from tests.scenes import mm, touch


class Seen(NamedTuple):
    """A state, and what a person says who sees how it ended."""

    what: str
    scene: Callable[[], scenes.Scene]
    edits: list[Edit]
    right: bool


def narrow_stick() -> scenes.Scene:
    """Of Fig. 3, with a stick that recedes on one side only."""
    built = scenes.stick_on_castles()
    narrow = scenes.solid("stick", scenes.box_faces((110, 10, 10), "py"), ((0, 0, 0), (110, 10, 10)))
    return replace(built, assembly=replace(built.assembly, solids={**built.assembly.solids, "stick": narrow}))


def blocks(names: str, operations: list[Operation], *goals: tuple[float, float, float]) -> scenes.Scene:
    """Alike blocks on the table."""
    solids = [scenes.table(), *(scenes.block(name) for name in names)]
    return scenes.scene(solids, operations, [mm(*at) for at in goals])


def on_table(part: str, *contacts: tuple) -> Operation:
    return Operation(part, touch(part, "table", "nz-top") + sum(contacts, ()))


def beside(part: str, other: str, pair: str) -> tuple:
    return touch(part, other, pair)


def kept() -> scenes.Scene:
    """A was aligned by B, which then goes to C and stays there: like a fixture, but it keeps a contact."""
    operations = [
        on_table("C"),
        on_table("B"),
        on_table("A", beside("A", "B", "px-nx")),
        on_table("B", beside("B", "C", "nx-px")),
    ]
    return blocks("ABC", operations, (200, 0, 25), (50, 0, 25), (0, 0, 25), (250, 0, 25))


def used_later() -> scenes.Scene:
    """A was aligned by B, which is put away and then carries D."""
    operations = [
        on_table("B"),
        on_table("A", beside("A", "B", "px-nx")),
        on_table("B"),
        Operation("D", touch("D", "B", "nz-pz")),
    ]
    return blocks("ABD", operations, (50, 0, 25), (0, 0, 25), (150, 0, 25), (150, 0, 75))


def aligned_twice() -> scenes.Scene:
    """A is aligned by B, then taken to D and aligned by that, which goes away: A is the product, D the fixture."""
    operations = [
        on_table("B"),
        on_table("A", beside("A", "B", "px-nx")),
        on_table("D"),
        on_table("A", beside("A", "D", "px-nx")),
        on_table("D"),
    ]
    return blocks("ABD", operations, (50, 0, 25), (0, 0, 25), (50, 120, 25), (0, 120, 25), (150, 120, 25))


def at_edge(share: float) -> np.ndarray:
    """Puts what stands in the middle of the assembly at the table's edge, so much of 60 mm on it."""
    return mm(700 + 30 - 60 * share, 0, 0)


HALF_Y = (0, 180, 0)
HALF_Z = (0, 0, 180)
QUARTER_X = (90, 0, 0)
QUARTER_Z = (0, 0, 90)
IN_A = mm(-60, 150, 19)
IN_B = mm(60, 150, 19)

TURNED = [
    Seen("tower, the stick turned by a quarter about its length", TOWER, [shift("stick", 3, 0, 0, 0, QUARTER_X)], True),
    Seen(
        "tower, castle 1 turned by a quarter, its slot across", TOWER, [shift("castle1", 1, 0, 0, 0, QUARTER_Z)], False
    ),
    Seen(
        "carried stick, the cube turned by a quarter, its hole across",
        CARRIED,
        [shift("cube", 3, 0, 0, 0, QUARTER_Z)],
        False,
    ),
    Seen("bridge, A lies along the seam, turned by 80 degrees", BRIDGE, [shift("A", 3, 0, 0, 0, (0, 0, 80))], False),
    Seen(
        "narrow stick, turned so that its fit side stays at its wall",
        narrow_stick,
        [shift("stick", 3, 0, 0, 0, HALF_Y)],
        True,
    ),
    Seen(
        "narrow stick, turned end for end: its fit side at the other wall",
        narrow_stick,
        [shift("stick", 3, 0, 0, 0, HALF_Z)],
        False,
    ),
]
"""Turns of single parts."""

ELSEWHERE = [
    Seen("tower, 150 mm further and turned by 30 degrees", TOWER, [moved(1, mm(150, -80, 0, (0, 0, 30)))], True),
    Seen(
        "castles, all of it turned by a quarter, give or take a little play",
        CASTLES,
        [
            moved(1, mm(0, 60, 0, QUARTER_Z)),
            shift("castle1", 1, 0, 0, 0, (0, 0, 0.2)),
            shift("stick", 3, 0, 0, 0, (0, 0, -0.05)),
        ],
        True,
    ),
    Seen("bridge, turned by 60 degrees", BRIDGE, [moved(1, mm(40, -200, 0, (0, 0, 60)))], True),
    Seen("tower, at the table's edge, 51 % of castle 1 on it", TOWER, [moved(1, at_edge(0.51))], True),
    Seen("tower, at the table's edge, 49 % of castle 1 on it", TOWER, [moved(1, at_edge(0.49))], False),
    Seen("tower, all of it 3 mm above the table", TOWER, [moved(1, mm(0, 0, 3))], False),
    Seen(
        "bridge, B and C in each other's place", BRIDGE, [put("B", 1, mm(25, 0, 25)), put("C", 2, mm(-25, 0, 25))], True
    ),
    Seen("pockets, the cubes in each other's pocket", POCKETS, [put("cube2", 6, IN_B), put("cube3", 6, IN_A)], True),
]
"""Right or wrong in itself, at another place."""

AFTERWARDS = [
    Seen("tower, all of it turned by 5 degrees at the end", TOWER, [moved(END, mm(0, 0, 0, (0, 0, 5)))], True),
    Seen("tower, the stick turned by 0.6 degrees at the end", TOWER, [shift("stick", END, 0, 0, 0, (0, 0, 0.6))], True),
    Seen(
        "castles, the stick turned by 0.4 degrees into the walls",
        CASTLES,
        [shift("stick", END, 0, 0, 0, (0, 0, 0.4))],
        False,
    ),
    Seen("pockets, the stick works itself out at the end", POCKETS, [shift("stick", END, 60, 0, 0)], False),
]
"""What happened to it after it was built."""

ON_THE_WAY = [
    Seen("tower, the last operation was not ended, yet everything is in its place", TOWER, [never(3)], True),
    Seen(
        "carried stick, the cube hung 5 mm above castle 1 when it got the stick",
        CARRIED,
        [moved(3, mm(0, 0, 5), "cube", "stick", until=5)],
        True,
    ),
    Seen("aligned blocks, A stands 3 mm off where B was", ALIGNED, [shift("A", 2, -3, 0, 0)], True),
]
"""What only those see who were there meanwhile."""

MARGINS = [
    Seen("bridge, A over 51 % of each block", BRIDGE, [shift("A", 3, 0, 24.5, 0)], True),
    Seen("bridge, A over 49 % of each block", BRIDGE, [shift("A", 3, 0, 25.5, 0)], False),
    Seen("bridge, A 0.09 mm above the blocks", BRIDGE, [shift("A", 3, 0, 0, 0.09)], True),
    Seen("bridge, A 0.11 mm above the blocks", BRIDGE, [shift("A", 3, 0, 0, 0.11)], False),
]
"""Just below and just above a threshold."""

FIXTURES = [
    Seen(
        "fixture, the cube was not put away: it stands against castle 2",
        FIXTURE,
        [put("cube", 4, mm(70, 55, 25))],
        True,
    ),
    Seen("fixture, the cube put down on the finished assembly", FIXTURE, [put("cube", 4, mm(70, 0, 75))], False),
    Seen("fixture, the cube is still held at the end", FIXTURE, [state(END, released=False)], False),
    Seen("fixture, castle 2 pushed by 2 mm when the cube was taken", FIXTURE, [shift("castle2", 4, 0, 2, 0)], False),
    Seen("kept block: B ends 10 mm off C", kept, [shift("B", 4, 10, 0, 0)], False),
    Seen(
        "block used later: B pushed by 3 mm under D", used_later, [shift("B", 4, 3, 0, 0), shift("D", 4, 3, 0, 0)], True
    ),
    Seen("block aligned twice: A pushed by 5 mm when D goes", aligned_twice, [shift("A", 5, -5, 0, 0)], True),
]
"""Parts that were used and put away, and parts that only look like that."""

STATES = [*TURNED, *ELSEWHERE, *AFTERWARDS, *ON_THE_WAY, *MARGINS, *FIXTURES]


ALIKE = "parts of one kind do not stand for each other: a contact names its parts, and only contacts are asked for"
NEAR_TRUTH = (
    "the symmetry of a part is the one nearest to its true pose in the room, so beyond 45 degrees a block, and beyond "
    "90 degrees a castle or a stick, may be read as turned within the assembly"
)
NOT_ENDED = "every operation must have ended"
DIFFERS = {
    "bridge, A lies along the seam, turned by 80 degrees": "no contact fixes its turn, and half of each top is covered",
    "castles, all of it turned by a quarter, give or take a little play": NEAR_TRUTH,
    "bridge, turned by 60 degrees": NEAR_TRUTH,
    "bridge, B and C in each other's place": ALIKE,
    "pockets, the cubes in each other's pocket": f"{ALIKE}; fixed parts have no symmetry either",
    "tower, the last operation was not ended, yet everything is in its place": NOT_ENDED,
    "fixture, the cube put down on the finished assembly": "where a fixture ends is free",
}
"""States of which the rule says otherwise than the person, and what in the rule does."""


class Loose(NamedTuple):
    """A state that is not right, and whether a person says that it nearly is: within 5 mm and 5 degrees."""

    what: str
    scene: Callable[[], scenes.Scene]
    edits: list[Edit]
    nearly: bool


LOOSE = [
    Loose("bridge, A 4.9 mm above the blocks", BRIDGE, [shift("A", 3, 0, 0, 4.9)], True),
    Loose("bridge, A 5.1 mm above the blocks", BRIDGE, [shift("A", 3, 0, 0, 5.1)], False),
    Loose("tower, the stick 4.9 degrees askew", TOWER, [shift("stick", 3, 0, 0, 0, (0, 0, 4.9))], True),
    Loose("tower, the stick 5.1 degrees askew", TOWER, [shift("stick", 3, 0, 0, 0, (0, 0, 5.1))], False),
]
