"""States to audit the judge with, after `audited_states`: wholes and halves of them that were nudged or turned.

The verdicts were written down before the judge was asked. The person sees the finished assembly and knows where each
part was put on the others, to a millimetre; where the whole was put on the table the person does not know.
"""

from __future__ import annotations

from tests.audited_states import HALF_Z, QUARTER_X, Seen, kept, used_later
from tests.end_states import BRIDGE, CARRIED, CASTLES, END, FIXTURE, POCKETS, TOWER, moved, put, shift
from tests.scenes import mm

UPPER = ("castle2", "stick")
TWO = ("cube2", "cube3", "stick")

WHOLES = [
    Seen("tower, all of it nudged by 40 mm at the end", TOWER, [moved(END, mm(40, 0, 0))], True),
    Seen("tower, all of it turned by 40 degrees at the end", TOWER, [moved(END, mm(0, 0, 0, (0, 0, 40)))], True),
    Seen("tower, all of it turned by 130 degrees at the end", TOWER, [moved(END, mm(0, 0, 0, (0, 0, 130)))], True),
    Seen("tower, all of it tipped over onto its side", TOWER, [moved(END, mm(0, 0, 30, QUARTER_X))], False),
    Seen("tower, castle 1 pushed by 5 mm when castle 2 came onto it", TOWER, [moved(2, mm(5, 3, 0))], True),
    Seen("castles, all of it turned by 20 degrees at the end", CASTLES, [moved(END, mm(0, 0, 0, (0, 0, 20)))], True),
    Seen("castles, all of it pushed by 3 mm across the stick at the end", CASTLES, [moved(END, mm(0, 3, 0))], True),
    Seen("carried stick, all of it nudged by 6 mm at the end", CARRIED, [moved(END, mm(4, -4.5, 0))], True),
    Seen("bridge, all of it nudged by 5 mm at the end", BRIDGE, [moved(END, mm(3, 4, 0))], True),
    Seen("bridge, all of it turned by 30 degrees at the end", BRIDGE, [moved(END, mm(0, 0, 0, (0, 0, 30)))], True),
    Seen(
        "fixture, the castles with the stick nudged by 4 mm at the end, the cube not",
        FIXTURE,
        [moved(END, mm(4, 0, 0), "castle1", "castle2", "stick")],
        True,
    ),
    Seen("kept block: B and C pushed by 7 mm at the end", kept, [moved(END, mm(0, 7, 0), "B", "C")], True),
    Seen("kept block: A, which stands alone, pushed by 7 mm at the end", kept, [moved(END, mm(0, 7, 0), "A")], True),
    Seen("block used later: B with D on it nudged by 20 mm at the end", used_later, [moved(END, mm(0, 20, 0))], True),
    Seen("pockets, cubes and stick pushed by 0.3 mm at the end", POCKETS, [moved(END, mm(0.3, 0, 0), *TWO)], True),
]
"""Moved as one."""

HALVES = [
    Seen("tower, castle 2 with the stick nudged by 1.5 mm along", TOWER, [moved(END, mm(1.5, 0, 0), *UPPER)], False),
    Seen("tower, castle 2 with the stick nudged by 0.8 mm along", TOWER, [moved(END, mm(0.8, 0, 0), *UPPER)], True),
    Seen("tower, castle 1 pulled by 1.5 mm along under the rest", TOWER, [shift("castle1", END, 1.5, 0, 0)], False),
    Seen("tower, the stick slid by 1.5 mm along at the end", TOWER, [shift("stick", END, 1.5, 0, 0)], False),
    Seen("tower, the stick slid by 1.5 mm along when it was put", TOWER, [shift("stick", 3, 1.5, 0, 0)], True),
    Seen(
        "tower, all of it turned by 5 degrees, and the stick slid by 1.5 mm",
        TOWER,
        [moved(END, mm(0, 0, 0, (0, 0, 5))), shift("stick", END, 1.5, 0, 0)],
        False,
    ),
    Seen(
        "tower, castle 2 slid by 0.9 mm one way, the stick by 0.9 mm the other",
        TOWER,
        [shift("castle2", END, 0.9, 0, 0), shift("stick", END, -0.9, 0, 0)],
        False,
    ),
    Seen("castles, castle 2 pushed by 1.5 mm along the stick", CASTLES, [shift("castle2", END, 1.5, 0, 0)], False),
    Seen(
        "castles, castle 1 and the stick nudged by 1.5 mm along, castle 2 not",
        CASTLES,
        [moved(END, mm(1.5, 0, 0), "castle1", "stick")],
        False,
    ),
    Seen(
        "castles, castle 2 pushed by 0.3 mm across the stick, in its play",
        CASTLES,
        [shift("castle2", END, 0, 0.3, 0)],
        True,
    ),
    Seen(
        "carried stick, the cube with the stick slid by 1.5 mm along the slots",
        CARRIED,
        [moved(END, mm(1.5, 0, 0), "cube", "stick")],
        False,
    ),
    Seen("carried stick, the cube slid by 1.5 mm along the stick", CARRIED, [shift("cube", END, 1.5, 0, 0)], False),
    Seen("carried stick, the cube slid by 0.7 mm along the stick", CARRIED, [shift("cube", END, 0.7, 0, 0)], True),
    Seen("bridge, A slid by 1.5 mm on both blocks", BRIDGE, [shift("A", END, 1.5, 0, 0)], False),
    Seen("bridge, B and C nudged by 1.5 mm under A", BRIDGE, [moved(END, mm(0, 1.5, 0), "B", "C")], False),
    Seen("bridge, C slid by 1.5 mm along B", BRIDGE, [shift("C", END, 0, 1.5, 0)], False),
    Seen("bridge, A turned by 2 degrees on the blocks", BRIDGE, [shift("A", END, 0, 0, 0, (0, 0, 2))], False),
    Seen("bridge, A turned end for end at the end", BRIDGE, [shift("A", END, 0, 0, 0, HALF_Z)], True),
    Seen("block used later: D slid by 1.5 mm on B", used_later, [shift("D", END, 0, 1.5, 0)], False),
    Seen("block used later: B pulled by 1.5 mm under D", used_later, [shift("B", END, 1.5, 0, 0)], False),
    Seen("kept block: C pushed by 1.5 mm along B", kept, [shift("C", END, 0, 1.5, 0)], False),
    Seen("pockets, the stick slid by 1.5 mm in both cubes", POCKETS, [shift("stick", END, 1.5, 0, 0)], False),
    Seen("pockets, cube 1, put away, nudged by 30 mm", POCKETS, [shift("cube1", END, 0, 30, 0)], True),
    Seen(
        "pockets, cube 2 out of its pocket, on the table beside it", POCKETS, [put("cube2", 7, mm(-60, 60, 25))], False
    ),
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
