"""States to audit the judge with, after `audited_states`: wholes and halves of them that were nudged or turned.

The verdicts were written down before the judge was asked. The person sees the finished assembly and knows where each
part was put on the others, to a millimetre; where the whole was put on the table the person does not know.
"""

from __future__ import annotations

from tests.audited_states import HALF_Z, Seen, kept
from tests.end_states import BRIDGE, CASTLES, END, FIXTURE, TOWER, moved, shift
from tests.scenes import mm

UPPER = ("castle2", "stick")

WHOLES = [
    Seen("tower, all of it nudged by 40 mm at the end", TOWER, [moved(END, mm(40, 0, 0))], True),
    Seen("tower, all of it turned by 130 degrees at the end", TOWER, [moved(END, mm(0, 0, 0, (0, 0, 130)))], True),
    Seen("tower, castle 1 pushed by 5 mm when castle 2 came onto it", TOWER, [moved(2, mm(5, 3, 0))], True),
    Seen(
        "fixture, the castles with the stick nudged by 4 mm at the end, the cube not",
        FIXTURE,
        [moved(END, mm(4, 0, 0), "castle1", "castle2", "stick")],
        True,
    ),
    Seen("kept block: B and C pushed by 7 mm at the end", kept, [moved(END, mm(0, 7, 0), "B", "C")], True),
]
"""Moved as one."""

HALVES = [
    Seen("tower, castle 2 with the stick nudged by 1.5 mm along", TOWER, [moved(END, mm(1.5, 0, 0), *UPPER)], False),
    Seen("tower, the stick slid by 1.5 mm along at the end", TOWER, [shift("stick", END, 1.5, 0, 0)], False),
    Seen("tower, the stick slid by 1.5 mm along when it was put", TOWER, [shift("stick", 3, 1.5, 0, 0)], True),
    Seen(
        "tower, castle 2 slid by 0.9 mm one way, the stick by 0.9 mm the other",
        TOWER,
        [shift("castle2", END, 0.9, 0, 0), shift("stick", END, -0.9, 0, 0)],
        False,
    ),
    Seen(
        "castles, castle 2 pushed by 0.3 mm across the stick, in its play",
        CASTLES,
        [shift("castle2", END, 0, 0.3, 0)],
        True,
    ),
    Seen("bridge, A turned by 2 degrees on the blocks", BRIDGE, [shift("A", END, 0, 0, 0, (0, 0, 2))], False),
    Seen("bridge, A turned end for end at the end", BRIDGE, [shift("A", END, 0, 0, 0, HALF_Z)], True),
]
"""Parts of a whole moved, the others not."""

STATES = [*WHOLES, *HALVES]

DIFFERS = {
    "tower, castle 2 slid by 0.9 mm one way, the stick by 0.9 mm the other": (
        "what slid counts no farther than one of the two parts moved in the room"
    ),
    "bridge, A turned end for end at the end": (
        "a part may be put in by any of its symmetries, but of turns after that only those about the axis of a part of "
        "revolution are none"
    ),
}
"""States of which the rule says otherwise than the person, and what in the rule does."""
