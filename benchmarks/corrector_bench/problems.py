"""The problems: contact equations whose truth, rank and free motions are known without any solver.

Figures 2, 3 and 6 of the paper are the operations of the scenarios `bridge_cycle`, `stick_on_castles` and
`pocket_table` (Fig. 6 without its fourth operation, which no later contact mentions). A chain is K castles on a line,
140 mm apart, with a stick in the slots of each two neighbours; a grid is G x G castles with slots both ways. All sides
touch: clearance is a matter of `walls.py` here.

The free motions are written down from the geometry: a planar motion of everything that hangs together, and slides of
single parts along their slots. They span the null space of the equations at every consistent configuration, so drift
and the report of freedom are judged by geometry, not by a singular value that someone had to call zero.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import final

import numpy as np

from apo_bench.assembly import Assembly, Contact, Equations, Operation, PartFace, Poses
from apo_bench.assembly.equations import equations
from apo_bench.geometry import Array, Box, Face, Solid, pose
from apo_bench.scenario.file import load_scenario
from apo_bench.scenario.parts.load import load_part

PITCH_M = 0.14
FIGURES = ("fig2", "fig3", "fig6")
X = np.eye(6)[0]
Y = np.eye(6)[1]
YAW = np.eye(6)[5]


@final
@dataclass(frozen=True, eq=False)
class Problem:
    """An assembly, one consistent configuration of it, and all ways to move without leaving consistency."""

    name: str
    assembly: Assembly
    start: Poses
    goals: Array
    """(n, 4, 4), exactly consistent, world frame, [m]."""
    together: tuple[int, ...]
    """Operations whose goals may be moved by one planar motion of the world."""
    slides: Array
    """(f - 3, n, 6): body twists that are free wherever the configuration is consistent, [m, rad]."""

    @property
    def n(self) -> int:
        return len(self.assembly)

    @property
    def rank(self) -> int:
        return 6 * self.n - 3 - len(self.slides)

    @cached_property
    def rows(self) -> int:
        return len(self.system(self.goals))

    def system(self, goals: Array) -> Equations:
        """The contact equations, their vertices taken at `goals` as a corrector would."""
        return equations(self.assembly, self.start, goals)

    def free(self, goals: Array) -> Array:
        """All free body twists at consistent goals, (6 n, f), not orthogonal."""
        planar = np.zeros((3, self.n, 6))
        at = list(self.together)
        planar[:, at] = np.swapaxes(_adjoint(pose.inverse(goals[at])) @ np.array([X, Y, YAW]).T, 1, 2).swapaxes(0, 1)
        return np.concatenate([planar, self.slides]).reshape(-1, 6 * self.n).T


def problem(name: str) -> Problem:
    """`fig2`, `fig3`, `fig6`, `chainK` or `gridG`."""
    if name in FIGURES:
        return {"fig2": fig2, "fig3": fig3, "fig6": fig6}[name]()
    for stem, make in (("chain", chain), ("grid", grid)):
        if name.startswith(stem) and name[len(stem) :].isdigit():
            return make(int(name[len(stem) :]))
    raise SystemExit(f"there is no problem '{name}'; give fig2, fig3, fig6, chainK or gridG, with a number for K or G.")


def fig2() -> Problem:
    """A bridge on two blocks that touch each other: a cycle of contacts (20 rows, rank 11)."""
    slides = _slides(3, [{1: Y}, {2: X}, {2: Y}, {2: YAW}])
    return _scenario("fig2", "bridge_cycle", (0, 1, 2), slides)


def fig3() -> Problem:
    """A stick in the slots of two castles (32 rows, rank 13)."""
    return _scenario("fig3", "stick_on_castles", (0, 1, 2), _slides(3, [{1: X}, {2: X}]))


def fig6() -> Problem:
    """Two cubes, spaced by a third, threaded on a stick and lowered into two pockets (88 rows, rank 25).

    The numbers are T1, T2, T3, T5, T6 of the paper. A slide of the stick through the holes turns up in T5 and T6.
    """
    scenario = load_scenario("pocket_table")
    assembly = scenario.assembly
    kept = [0, 1, 2, 4, 5]
    left = Assembly(assembly.solids, tuple(assembly.operations[k] for k in kept), assembly.fixed)
    slides = _slides(5, [{0: Y}, {3: X, 4: X}])
    return Problem("fig6", left, _start(left), scenario.goals[kept], (0, 1, 2, 3), slides)


def chain(castles: int) -> Problem:
    """A line of castles, a stick between each two neighbours (28 K - 24 rows, n = 6 (2 K - 1), rank 10 K - 7)."""
    assembly, goals = lined_up(castles)
    n = len(assembly)
    slides = _slides(n, [{k: X} for k in range(1, n)])
    return Problem(f"chain{castles}", assembly, _start(assembly), goals, tuple(range(n)), slides)


def lined_up(castles: int) -> tuple[Assembly, Array]:
    """The assembly of a chain and its goals, (2 K - 1, 4, 4): first all castles, then all sticks."""
    castle = load_part("castle")
    stick = load_part("stick")
    table = load_part("table")
    operations = [_standing(f"castle{k}") for k in range(castles)]
    operations += [_lying(f"stick{k}", [f"castle{k}", f"castle{k + 1}"]) for k in range(castles - 1)]
    goals = [pose.at([k * PITCH_M, 0, 0]) for k in range(castles)]
    goals += [pose.at([(k + 0.5) * PITCH_M, 0, 0.04]) for k in range(castles - 1)]
    solids = {"table": table}
    solids |= {op.main: castle if op.main.startswith("castle") else stick for op in operations}
    return Assembly(solids, tuple(operations), frozenset({"table"})), np.array(goals)


def grid(side: int) -> Problem:
    """G x G castles with crossing slots, a stick between each two neighbours.

    52 G^2 - 48 G rows, n = 6 (3 G^2 - 2 G), rank 16 G^2 - 12 G - 1.
    Whole rows may move across, whole columns along, and every stick along its slots.
    """
    cross = crossed()
    stick = load_part("stick")
    table = load_part("table")
    operations = list[Operation]()
    goals = list[Array]()
    where = dict[tuple[int, int], int]()
    for i, j in np.ndindex(side, side):
        where[i, j] = len(operations)
        operations.append(_standing(f"castle{i}_{j}"))
        goals.append(pose.at([j * PITCH_M, i * PITCH_M, 0]))
    rows: list[dict[int, Array]] = [{where[i, j]: Y for j in range(side)} for i in range(side)]
    columns: list[dict[int, Array]] = [{where[i, j]: X for i in range(side)} for j in range(side)]
    along = list[Mapping[int, Array]]()
    for i, j in np.ndindex(side, side):
        for turned, (i2, j2) in enumerate(((i, j + 1), (i + 1, j))):
            if i2 < side and j2 < side:
                k = len(operations)
                pair = [f"castle{i}_{j}", f"castle{i2}_{j2}"]
                operations.append(_lying(f"stick{k}", pair, "y" if turned else "x"))
                middle = [(j + j2) / 2 * PITCH_M, (i + i2) / 2 * PITCH_M, 0.04]
                goals.append(pose.at(middle, [0, 0, 90 * turned]))
                (columns[j] if turned else rows[i])[k] = -Y if turned else Y
                along.append({k: X})
    solids = {"table": table}
    solids |= {op.main: cross if op.main.startswith("castle") else stick for op in operations}
    assembly = Assembly(solids, tuple(operations), frozenset({"table"}))
    n = len(operations)
    slides = _slides(n, [*rows[1:], *columns[1:], *along])
    return Problem(f"grid{side}", assembly, _start(assembly), np.array(goals), tuple(range(n)), slides)


def crossed() -> Solid:
    """A castle with slots along x and along y: the numbers of the castle, four merlons in place of two."""
    inner = 0.01
    outer = 0.03
    floor = 0.03
    top = 0.04
    boxes = [Box("base", np.array([0, 0, floor / 2]), np.array([outer, outer, floor / 2]))]
    middle = (inner + outer) / 2
    half = (outer - inner) / 2
    for k, (sx, sy) in enumerate(((1, 1), (-1, 1), (-1, -1), (1, -1))):
        center = np.array([sx * middle, sy * middle, (floor + top) / 2])
        boxes.append(Box(f"merlon{k}", center, np.array([half, half, (top - floor) / 2])))
    slot = np.array([[outer, inner, floor], [-outer, inner, floor], [-outer, -inner, floor], [outer, -inner, floor]])
    turn = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    wall = np.array([[outer, inner, floor], [-outer, inner, floor], [-outer, inner, top], [outer, inner, top]])
    bottom = np.array([[outer, outer, 0], [outer, -outer, 0], [-outer, -outer, 0], [-outer, outer, 0]])
    faces = [Face("bottom", bottom)]
    half_turn = turn @ turn
    for axis, R in (("x", np.eye(3)), ("y", turn)):
        faces.append(Face(f"floor_{axis}", slot @ R.T))
        faces.append(Face(f"left_{axis}", wall @ R.T))
        faces.append(Face(f"right_{axis}", wall @ (R @ half_turn).T))
    return Solid("crossed", {face.name: face for face in faces}, tuple(boxes), np.array([0, 0, 0.018]), 1.2e-4)


def _standing(castle: str) -> Operation:
    return Operation(castle, (Contact(PartFace(castle, "bottom"), PartFace("table", "top")),))


def _lying(stick: str, castles: Sequence[str], slot: str = "") -> Operation:
    """The stick's lower face and both sides, in the slots of two castles."""
    names = (f"floor_{slot}", f"left_{slot}", f"right_{slot}") if slot else ("sfl", "spy", "sny")
    faces = tuple(zip(("nz", "py", "ny"), names, strict=True))
    return Operation(stick, tuple(Contact(PartFace(stick, a), PartFace(c, b)) for c in castles for a, b in faces))


def _scenario(name: str, scenario: str, together: tuple[int, ...], slides: Array) -> Problem:
    given = load_scenario(scenario)
    return Problem(name, given.assembly, _start(given.assembly), given.goals, together, slides)


def _start(assembly: Assembly) -> Poses:
    """Fixed parts at the origin; where the others start plays no part, since every contact is of moved ones."""
    return {part: np.eye(4) for part in assembly.solids}


def _slides(n: int, motions: Sequence[Mapping[int, Array]]) -> Array:
    out = np.zeros((len(motions), n, 6))
    for row, motion in zip(out, motions, strict=True):
        for k, twist in motion.items():
            row[k] = twist
    return out


def _adjoint(T: Array) -> Array:
    """Ad of poses (k, 4, 4) on twists (v, w), (k, 6, 6)."""
    out = np.zeros((len(T), 6, 6))
    R = T[:, :3, :3]
    out[:, :3, :3] = out[:, 3:, 3:] = R
    out[:, :3, 3:] = pose.hat(T[:, :3, 3]) @ R
    return out
