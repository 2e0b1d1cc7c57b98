"""Observations on which correctors are measured: three examples of the paper, and assemblies of any size.

Figures 2, 3 and 6 of the paper are the operations of the scenarios `bridge_cycle`, `stick_on_castles` and
`pocket_table` (Fig. 6 without its fourth operation, which no later contact mentions). A chain is K castles on a line,
140 mm apart, with a stick in the slots of each two neighbours; a grid is G x G castles with slots both ways.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from apo_bench import Assembly, Observation, load_scenario
from apo_bench.assembly import Contact, Operation, PartFace, Poses
from apo_bench.geometry import Array, Box, Face, Solid, pose
from apo_bench.scenario.parts.load import load_part

PITCH_M = 0.14
FIGURES = {"fig2": "bridge_cycle", "fig3": "stick_on_castles", "fig6": "pocket_table"}
KEPT_OF_FIG6 = [0, 1, 2, 4, 5]


class Problem(NamedTuple):
    """An assembly and one consistent configuration of it."""

    assembly: Assembly
    start: Poses
    poses: Array
    """(n, 4, 4), exactly consistent, world frame, [m]."""


def problem(name: str) -> Problem:
    """Return `fig2`, `fig3`, `fig6`, `chainK` or `gridG`."""
    if name in FIGURES:
        return figure(name)
    size = int(name.removeprefix("chain").removeprefix("grid"))
    return chain(size) if name.startswith("chain") else grid(size)


def observe(of: Problem, seed: int, mm: float = 2.0, deg: float = 1.0) -> Observation:
    """Return the observation of one seed: T_observed = T_true exp(xi), xi ~ N(0, covariance)."""
    n = len(of.assembly)
    sigma = np.array([1e-3 * mm] * 3 + [np.radians(deg)] * 3)
    twists = sigma * np.random.default_rng(seed).standard_normal((n, 6))
    covariance = np.broadcast_to(np.diag(sigma**2), (n, 6, 6))
    return Observation(of.assembly, of.start, of.poses @ pose.exp(twists), covariance, np.ones(n, dtype=np.bool_))


def figure(name: str) -> Problem:
    """Return an example of the paper."""
    scenario = load_scenario(FIGURES[name])
    assembly, poses = scenario.assembly, np.array(scenario.nominal_poses)
    if name == "fig6":
        assembly = replace(assembly, operations=tuple(assembly.operations[k] for k in KEPT_OF_FIG6))
        poses = poses[KEPT_OF_FIG6]
    return Problem(assembly, _origins(assembly), poses)


def chain(castles: int) -> Problem:
    """Return a line of castles, then a stick between each two neighbours (2 K - 1 operations, rank 10 K - 7)."""
    names = [f"castle{k}" for k in range(castles)]
    operations = [_standing(name) for name in names]
    operations += [_lying(f"stick{k}", names[k : k + 2]) for k in range(castles - 1)]
    poses = [pose.at([k * PITCH_M, 0, 0]) for k in range(castles)]
    poses += [pose.at([(k + 0.5) * PITCH_M, 0, 0.04]) for k in range(castles - 1)]
    return _assembled(operations, load_part("castle"), poses)


def grid(side: int) -> Problem:
    """Return G x G castles with crossing slots, a stick between each two neighbours (rank 16 G^2 - 12 G - 1)."""
    places = list(np.ndindex(side, side))
    operations = [_standing(f"castle{i}_{j}") for i, j in places]
    poses = [pose.at([j * PITCH_M, i * PITCH_M, 0]) for i, j in places]
    for i, j in places:
        for axis, i2, j2 in (("x", i, j + 1), ("y", i + 1, j)):
            if max(i2, j2) < side:
                pair = [f"castle{i}_{j}", f"castle{i2}_{j2}"]
                operations.append(_lying(f"stick{len(operations)}", pair, f"_{axis}"))
                middle = [(j + j2) / 2 * PITCH_M, (i + i2) / 2 * PITCH_M, 0.04]
                poses.append(pose.at(middle, [0, 0, 90.0 * (axis == "y")]))
    return _assembled(operations, _crossed_castle(), poses)


def _assembled(operations: Sequence[Operation], castle: Solid, poses: Sequence[Array]) -> Problem:
    stick = load_part("stick")
    solids = {"table": load_part("table")}
    for operation in operations:
        solids[operation.main] = castle if operation.main.startswith("castle") else stick
    assembly = Assembly(solids, tuple(operations), frozenset({"table"}))
    return Problem(assembly, _origins(assembly), np.array(poses))


def _crossed_castle() -> Solid:
    """Return a castle with slots along x and along y: the dimensions of the castle, four merlons in place of two."""
    inner, outer, floor, top = 0.01, 0.03, 0.03, 0.04
    middle, half = (inner + outer) / 2, (outer - inner) / 2
    boxes = [Box("base", np.array([0, 0, floor / 2]), np.array([outer, outer, floor / 2]))]
    for k, (x, y) in enumerate(((1, 1), (-1, 1), (-1, -1), (1, -1))):
        center = np.array([x * middle, y * middle, (floor + top) / 2])
        boxes.append(Box(f"merlon{k}", center, np.array([half, half, (top - floor) / 2])))
    slot = np.array([[outer, inner, floor], [-outer, inner, floor], [-outer, -inner, floor], [outer, -inner, floor]])
    wall = np.array([[outer, inner, floor], [-outer, inner, floor], [-outer, inner, top], [outer, inner, top]])
    bottom = np.array([[outer, outer, 0], [outer, -outer, 0], [-outer, -outer, 0], [-outer, outer, 0]])
    quarter_turn = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    faces = [Face("bottom", bottom)]
    for axis, R in (("x", np.eye(3)), ("y", quarter_turn)):
        faces.append(Face(f"sfl_{axis}", slot @ R.T))
        faces.append(Face(f"spy_{axis}", wall @ R.T))
        faces.append(Face(f"sny_{axis}", wall @ (R @ quarter_turn @ quarter_turn).T))
    return Solid("crossed", {face.name: face for face in faces}, tuple(boxes), np.array([0, 0, 0.018]), 1.2e-4)


def _standing(castle: str) -> Operation:
    return Operation(castle, (Contact(PartFace(castle, "bottom"), PartFace("table", "top")),))


def _lying(stick: str, castles: Sequence[str], slot: str = "") -> Operation:
    """Return the operation that puts a stick into the slots of two castles: its lower face and both sides touch."""
    pairs = [(castle, own, other) for castle in castles for own, other in (("nz", "sfl"), ("py", "spy"), ("ny", "sny"))]
    return Operation(stick, tuple(Contact(PartFace(stick, a), PartFace(c, f"{b}{slot}")) for c, a, b in pairs))


def _origins(assembly: Assembly) -> Poses:
    """Return every part at the origin: where moved parts start plays no part in contacts of moved parts."""
    return {part: np.eye(4) for part in assembly.solids}
