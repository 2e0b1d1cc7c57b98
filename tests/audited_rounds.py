"""States with round and tilted faces to audit the judge with, as in `audited_states`: written before it was asked."""

from __future__ import annotations

import numpy as np

from tests.audited_states import HALF_Y, Seen
from tests.end_states import moved, put, shift
from tests.rounds import (
    countersink,
    dovetail,
    in_groove,
    loose_peg,
    nested,
    on_rim,
    on_table,
    peg_in_plate,
    through,
    wedges_meet,
)
from tests.scenes import mm

PEGS = [
    Seen("peg, turned by 30 degrees about its axis", peg_in_plate, [shift("peg", 2, 0, 0, 0, (0, 0, 30))], True),
    Seen("peg, 0.34 mm aside", peg_in_plate, [shift("peg", 2, 0.34, 0, 0)], True),
    Seen("peg, 0.36 mm aside", peg_in_plate, [shift("peg", 2, 0, -0.36, 0)], False),
    Seen("peg, leans by 0.9 degrees", peg_in_plate, [shift("peg", 2, 0, 0, 0, (0.9, 0, 0))], True),
    Seen("peg, leans by 1.1 degrees", peg_in_plate, [shift("peg", 2, 0, 0, 0, (0, 1.1, 0))], False),
    Seen("peg, plate and peg pushed by 1.1 mm at the insertion", peg_in_plate, [moved(2, mm(1.1, 0, 0))], True),
    Seen("thin peg, 0.19 mm aside where its size leaves 0.1", loose_peg, [shift("peg", 2, 0.19, 0, 0)], True),
    Seen("thin peg, 0.21 mm aside where its size leaves 0.1", loose_peg, [shift("peg", 2, 0.21, 0, 0)], False),
    Seen(
        "bush, 0.3 mm aside, the peg 0.3 mm aside in it",
        nested,
        [shift("bush", 2, 0.3, 0, 0), shift("peg", 3, 0.6, 0, 0)],
        True,
    ),
    Seen("bush, 0.36 mm aside, the peg in its middle", nested, [moved(2, mm(0.36, 0, 0), "bush", "peg")], False),
]
"""Pegs that stand in holes."""

SHAFTS = [
    Seen("shaft, 55 % of the second bore filled", through, [shift("peg", 3, 0, 0, 29)], True),
    Seen("shaft, 45 % of the second bore filled", through, [shift("peg", 3, 0, 0, 31)], False),
    Seen("shaft, skew by 0.15 degrees", through, [shift("peg", 3, 0, 0, 0, (0, 0.15, 0))], True),
    Seen("shaft, skew by 0.3 degrees", through, [shift("peg", 3, 0, 0, 0, (0, 0.3, 0))], False),
    Seen("groove, the shaft 26 mm along it, 39 of 50 mm in it", in_groove, [shift("peg", 2, 0, 0, 26)], True),
    Seen("groove, the shaft 0.12 mm up, 0.085 mm off both walls", in_groove, [shift("peg", 2, -0.12, 0, 0)], True),
    Seen("groove, the shaft 0.16 mm up, 0.113 mm off both walls", in_groove, [shift("peg", 2, -0.16, 0, 0)], False),
    Seen("lying shaft, 0.09 mm above the table", on_table, [shift("peg", 1, -0.09, 0, 0)], True),
    Seen("lying shaft, 0.11 mm above the table", on_table, [shift("peg", 1, -0.11, 0, 0)], False),
    Seen("lying shaft, 26 of 50 mm on the table", on_table, [put("peg", 1, mm(674, 0, 5, (0, 90, 0)))], True),
    Seen("lying shaft, 24 of 50 mm on the table", on_table, [put("peg", 1, mm(676, 0, 5, (0, 90, 0)))], False),
]
"""Shafts that lie, and shafts through two parts."""

CONES = [
    Seen("plug, 0.12 mm high, 0.085 mm off the wall", countersink, [shift("plug", 2, 0, 0, 0.12)], True),
    Seen("plug, 0.16 mm high, 0.113 mm off the wall", countersink, [shift("plug", 2, 0, 0, 0.16)], False),
    Seen(
        "rim, the plug tilted by 3 degrees on it",
        on_rim,
        [put("plug", 2, mm(0, 0, 20, (3, 0, 0)) @ mm(0, 0, -2))],
        True,
    ),
    Seen(
        "rim, the plug tilted by 6 degrees on it",
        on_rim,
        [put("plug", 2, mm(0, 0, 20, (6, 0, 0)) @ mm(0, 0, -2))],
        False,
    ),
    Seen("rim, the plug 0.09 mm aside", on_rim, [shift("plug", 2, 0.09, 0, 0)], True),
    Seen("rim, the plug 0.11 mm aside", on_rim, [shift("plug", 2, 0, -0.11, 0)], False),
]
"""Cones in their seats, and on the rim of a hole."""

SLOPE = np.radians(30.0)
DOWN = np.array([0.0, -np.cos(SLOPE), -np.sin(SLOPE)])
OUT = np.array([0.0, -np.sin(SLOPE), np.cos(SLOPE)])
TOP = 20.0 + 60.0 * np.tan(SLOPE)

TILTED = [
    Seen("wedges, 0.09 mm apart", wedges_meet, [moved(2, mm(*(0.09 * OUT)), "high")], True),
    Seen("wedges, 0.11 mm apart", wedges_meet, [moved(2, mm(*(0.11 * OUT)), "high")], False),
    Seen("wedges, the upper one turned by half a turn", wedges_meet, [put("high", 2, mm(0, 0, TOP, HALF_Y))], False),
    Seen("dovetail, 31 mm along, 49 of 60 mm on the rail", dovetail, [shift("slider", 2, -31, 0, 0)], True),
    Seen("dovetail, 0.4 mm aside, 0.346 mm off the walls", dovetail, [shift("slider", 2, 0, 0.4, 0)], True),
    Seen("dovetail, 0.42 mm aside, 0.364 mm off the walls", dovetail, [shift("slider", 2, 0, 0.42, 0)], False),
]
"""Faces that are neither level nor upright."""

STATES = [*PEGS, *SHAFTS, *CONES, *TILTED]

PLACE = (
    "between movable parts the overlap has its place on the environment face: less than half of the true one is covered"
)
DIFFERS = {
    "groove, the shaft 26 mm along it, 39 of 50 mm in it": PLACE,
    "dovetail, 31 mm along, 49 of 60 mm on the rail": PLACE,
}
"""States of which the rule says otherwise than the person, and what in the rule does."""
