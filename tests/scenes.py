"""The blocks and the examples of the paper, written out by hand: tests compare with these, not with what is read."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from apo_bench import Assembly, Demonstration, Observation
from apo_bench.assembly import Contact, Operation, PartFace, compute_placements
from apo_bench.geometry import Array, Box, Face, Solid, pose

AXES = {"x": 0, "y": 1, "z": 2}


def wall(name: str, axis: str, at: float, low: Sequence[float], high: Sequence[float], fit: bool = False) -> Face:
    """A rectangle [mm] that looks along `+x` .. `-z` at that coordinate; low and high are the other two, in order."""
    i = AXES[axis[1]]
    j, k = (c for c in range(3) if c != i)
    square = np.array([(low[0], low[1]), (high[0], low[1]), (high[0], high[1]), (low[0], high[1])])
    corners = np.empty((4, 3))
    corners[:, i] = at
    corners[:, j] = square[:, 0]
    corners[:, k] = square[:, 1]
    face = Face(name, corners * 1e-3, fit=fit)
    outwards = (axis[0] == "+") == (face.normal[i] > 0)
    return face if outwards else Face(name, corners[::-1] * 1e-3, fit=fit)


def box_faces(half: Sequence[float], fit: str = "") -> list[Face]:
    """px .. nz of a box about the origin, half sizes [mm]."""
    out = []
    for axis, i in AXES.items():
        j, k = (c for c in range(3) if c != i)
        for sign, letter in (("+", "p"), ("-", "n")):
            name = letter + axis
            at = half[i] if sign == "+" else -half[i]
            out.append(wall(name, sign + axis, at, (-half[j], -half[k]), (half[j], half[k]), name in fit.split()))
    return out


def solid(name: str, faces: Sequence[Face], *boxes: tuple[Sequence[float], Sequence[float]]) -> Solid:
    """Boxes as (centre, half sizes) [mm], disjoint."""
    solids = tuple(Box(f"box{i}", np.array(c) * 1e-3, np.array(h) * 1e-3) for i, (c, h) in enumerate(boxes))
    volumes = np.array([8 * np.prod(b.half) for b in solids])
    centroid = volumes @ np.array([b.center for b in solids]) / volumes.sum()
    return Solid(name, {face.name: face for face in faces}, solids, centroid, float(volumes.sum()))


def cuboid(name: str, half: Sequence[float]) -> Solid:
    return solid(name, box_faces(half), ((0, 0, 0), half))


def stick(name: str = "stick") -> Solid:
    return solid(name, box_faces((110, 10, 10), "py ny pz nz"), ((0, 0, 0), (110, 10, 10)))


def block(name: str = "block") -> Solid:
    return cuboid(name, (25, 25, 25))


def castle(name: str = "castle") -> Solid:
    """60 x 60 x 40, a slot 20 wide and 10 deep along x; frame: centre of the bottom."""
    faces = [
        wall("bottom", "-z", 0, (-30, -30), (30, 30)),
        wall("topP", "+z", 40, (-30, 10), (30, 30)),
        wall("topN", "+z", 40, (-30, -30), (30, -10)),
        wall("sfl", "+z", 30, (-30, -10), (30, 10)),
        wall("spy", "-y", 10, (-30, 30), (30, 40)),
        wall("sny", "+y", -10, (-30, 30), (30, 40)),
        wall("py", "+y", 30, (-30, 0), (30, 40)),
        wall("ny", "-y", -30, (-30, 0), (30, 40)),
    ]
    boxes = (((0, 0, 15), (30, 30, 15)), ((0, 20, 35), (30, 10, 5)), ((0, -20, 35), (30, 10, 5)))
    return solid(name, faces, *boxes)


def cube(name: str = "cube") -> Solid:
    """50 x 50 x 50 with a square hole of 20 along x; frame: centroid."""
    faces = [
        *(face for face in box_faces((25, 25, 25)) if face.name not in ("px", "nx")),
        wall("hpy", "-y", 10, (-25, -10), (25, 10)),
        wall("hny", "+y", -10, (-25, -10), (25, 10)),
        wall("hpz", "-z", 10, (-25, -10), (25, 10)),
        wall("hnz", "+z", -10, (-25, -10), (25, 10)),
    ]
    for face in box_faces((25, 25, 25)):
        if face.name in ("px", "nx"):
            hole = wall("hole", "-x" if face.name == "px" else "+x", float(face.plane[3]), (-10, -10), (10, 10)).outline
            hole = np.column_stack([np.full(4, face.outline[0, 0]), hole[:, 1:]])
            faces.append(Face(face.name, face.outline, (hole,)))
    boxes = (
        ((0, 0, 17.5), (25, 25, 7.5)),
        ((0, 0, -17.5), (25, 25, 7.5)),
        ((0, 17.5, 0), (25, 7.5, 10)),
        ((0, -17.5, 0), (25, 7.5, 10)),
    )
    return solid(name, faces, *boxes)


def table(name: str = "table") -> Solid:
    """Frame: centre of the top."""
    return solid(name, [wall("top", "+z", 0, (-700, -600), (700, 600))], ((0, 0, -10), (700, 600, 10)))


def table_with_pockets(name: str = "table") -> Solid:
    """Pockets A and B, 50 x 50 and 6 deep, at x = -60 and 60, y = 150; faces only, the slab is not cut."""
    faces = []
    holes = []
    for pocket, x in (("A", -60.0), ("B", 60.0)):
        faces += [
            wall(f"{pocket}_fl", "+z", -6, (x - 25, 125), (x + 25, 175)),
            wall(f"{pocket}_px", "-x", x + 25, (125, -6), (175, 0), fit=True),
            wall(f"{pocket}_nx", "+x", x - 25, (125, -6), (175, 0), fit=True),
            wall(f"{pocket}_py", "-y", 175, (x - 25, -6), (x + 25, 0), fit=True),
            wall(f"{pocket}_ny", "+y", 125, (x - 25, -6), (x + 25, 0), fit=True),
        ]
        holes.append(wall("hole", "-z", 0, (x - 25, 125), (x + 25, 175)).outline)
    top = wall("top", "+z", 0, (-700, -600), (700, 600))
    return solid(name, [Face("top", top.outline, tuple(holes)), *faces], ((0, 0, -13), (700, 600, 7)))


@dataclass(frozen=True, eq=False)
class Scene:
    """An example of the paper at its true goals."""

    assembly: Assembly
    start: Mapping[str, Array]
    nominal_poses: Array


def touch(manipulated: str, environment: str, *pairs: str) -> tuple[Contact, ...]:
    """Contacts of two parts, each pair as `nz-top`."""
    split = [pair.split("-") for pair in pairs]
    return tuple(Contact(PartFace(manipulated, m), PartFace(environment, e)) for m, e in split)


def scene(solids: Sequence[Solid], operations: Sequence[Operation], goals: Sequence[Array]) -> Scene:
    """Every part but the table waits half a metre away; nothing may depend on where."""
    start = {part.name: pose.at((-0.5 + 0.12 * i, 0.5, 0.0)) for i, part in enumerate(solids)}
    start["table"] = np.eye(4)
    assembly = Assembly({part.name: part for part in solids}, tuple(operations), frozenset({"table"}))
    return Scene(assembly, start, np.array(goals))


def mm(x: float, y: float, z: float, turn_deg: Sequence[float] = (0, 0, 0)) -> Array:
    return pose.at(np.array([x, y, z]) * 1e-3, turn_deg)


SLOT = ("nz-sfl", "py-spy", "ny-sny")
CEILING = ("pz-sfl", "py-sny", "ny-spy")
HOLE = ("py-hpy", "ny-hny", "pz-hpz", "nz-hnz")


def pocket(name: str) -> tuple[str, ...]:
    return f"nz-{name}_fl", f"px-{name}_px", f"nx-{name}_nx", f"py-{name}_py", f"ny-{name}_ny"


def bridge() -> Scene:
    """Fig. 2: block A on the blocks B and C, which touch each other."""
    solids = [table(), block("B"), block("C"), cuboid("A", (50, 25, 10))]
    operations = [
        Operation("B", touch("B", "table", "nz-top")),
        Operation("C", touch("C", "table", "nz-top") + touch("C", "B", "nx-px")),
        Operation("A", touch("A", "B", "nz-pz") + touch("A", "C", "nz-pz")),
    ]
    return scene(solids, operations, [mm(-25, 0, 25), mm(25, 0, 25), mm(0, 0, 60)])


def fixture_alignment() -> Scene:
    """Fig. 5: block A pushed against the fixture B, which is taken away again."""
    operations = [
        Operation("B", touch("B", "table", "nz-top")),
        Operation("A", touch("A", "table", "nz-top") + touch("A", "B", "px-nx")),
        Operation("B", touch("B", "table", "nz-top")),
    ]
    solids = [table(), block("B"), block("A")]
    return scene(solids, operations, [mm(50, 0, 25), mm(0, 0, 25), mm(150, 0, 25)])


def stick_on_castles() -> Scene:
    """Fig. 3: a stick in the slots of two castles."""
    operations = [
        Operation("castle1", touch("castle1", "table", "bottom-top")),
        Operation("castle2", touch("castle2", "table", "bottom-top")),
        Operation("stick", touch("stick", "castle1", *SLOT) + touch("stick", "castle2", *SLOT)),
    ]
    solids = [table(), castle("castle1"), castle("castle2"), stick()]
    return scene(solids, operations, [mm(-70, 0, 0), mm(70, 0, 0), mm(0, 0, 40)])


def stick_in_tower() -> Scene:
    """Example 5.1: a stick in the hole between two castles, the upper one upside down."""
    operations = [
        Operation("castle1", touch("castle1", "table", "bottom-top")),
        Operation("castle2", touch("castle2", "castle1", "topP-topN", "topN-topP")),
        Operation("stick", touch("stick", "castle1", *SLOT) + touch("stick", "castle2", *CEILING)),
    ]
    solids = [table(), castle("castle1"), castle("castle2"), stick()]
    return scene(solids, operations, [mm(0, 0, 0), mm(0, 0, 80, (180, 0, 0)), mm(0, 0, 40)])


def subassembly_on_castles() -> Scene:
    """Example 5.2: a cube carries the stick that it holds onto two castles."""
    operations = [
        Operation("castle1", touch("castle1", "table", "bottom-top")),
        Operation("castle2", touch("castle2", "table", "bottom-top")),
        Operation("cube", touch("cube", "castle1", "nz-topP", "nz-topN")),
        Operation("stick", touch("stick", "cube", *HOLE)),
        Operation("cube", touch("stick", "castle1", *SLOT) + touch("stick", "castle2", *SLOT), carries=("stick",)),
    ]
    solids = [table(), castle("castle1"), castle("castle2"), cube(), stick()]
    goals = [mm(-70, 0, 0), mm(70, 0, 0), mm(-70, 0, 65), mm(-70, 0, 65), mm(0, 0, 40)]
    return scene(solids, operations, goals)


def fixture() -> Scene:
    """Example 5.3: a castle pushed against a cube that is taken away again."""
    operations = [
        Operation("castle1", touch("castle1", "table", "bottom-top")),
        Operation("cube", touch("cube", "table", "nz-top")),
        Operation("castle2", touch("castle2", "table", "bottom-top") + touch("castle2", "cube", "py-ny")),
        Operation("cube", touch("cube", "table", "nz-top")),
        Operation("stick", touch("stick", "castle1", *SLOT) + touch("stick", "castle2", *SLOT)),
    ]
    solids = [table(), castle("castle1"), castle("castle2"), cube(), stick()]
    goals = [mm(-70, 0, 0), mm(70, 55, 25), mm(70, 0, 0), mm(70, 140, 25), mm(0, 0, 40)]
    return scene(solids, operations, goals)


def pockets() -> Scene:
    """Fig. 6: two cubes on a stick, lowered together into two pockets."""
    operations = [
        Operation("cube1", touch("cube1", "table", "nz-top")),
        Operation("cube2", touch("cube2", "table", "nz-top")),
        Operation("cube3", touch("cube3", "table", "nz-top") + touch("cube3", "cube1", "px-nx")),
        Operation("cube1", touch("cube1", "table", "nz-top")),
        Operation("stick", touch("stick", "cube2", *HOLE) + touch("stick", "cube3", *HOLE)),
        Operation(
            "stick",
            touch("cube2", "table", *pocket("A")) + touch("cube3", "table", *pocket("B")),
            carries=("cube2", "cube3"),
        ),
    ]
    solids = [table_with_pockets(), block("cube1"), cube("cube2"), cube("cube3"), stick()]
    goals = [mm(110, 0, 25), mm(-60, 0, 25), mm(60, 0, 25), mm(200, -100, 25), mm(0, 0, 25), mm(0, 150, 19)]
    return scene(solids, operations, goals)


ALL = {
    "bridge": bridge,
    "fixture_alignment": fixture_alignment,
    "stick_on_castles": stick_on_castles,
    "stick_in_tower": stick_in_tower,
    "subassembly_on_castles": subassembly_on_castles,
    "fixture": fixture,
    "pockets": pockets,
}


def human_error(name: str, mm: float, low_mm: float = 0.0) -> tuple[Scene, Array]:
    """An example of Section 5 or Fig. 6 and what is seen of it: a part put aside, unnoticed, and mended at the end.

    Args:
        mm: How far aside: operation 2 along y, in example 5.3 with castle 2 against the cube, in Fig. 6 along x.
        low_mm: How far a stick sinks in its slot or hole, the clearance, before it is seen.
    """
    built = ALL[name]()
    goals = ALL[name]().nominal_poses.copy()
    goals[[1, 2] if name == "fixture" else [1], 0 if name == "pockets" else 1, 3] += mm * 1e-3
    lying = {"stick_in_tower": [2], "subassembly_on_castles": [3], "fixture": [4], "pockets": [4]}[name]
    goals[lying, 2, 3] -= low_mm * 1e-3
    return built, goals


def noisy(goals: Array, rng: np.random.Generator, mm: float, deg: float) -> Array:
    """Goals with a Gaussian body twist each."""
    return goals @ pose.exp(rng.standard_normal((len(goals), 6)) * np.repeat([mm * 1e-3, np.radians(deg)], 3))


def turned(scene: Scene, T_world: Array) -> Scene:
    """The same scene in another world frame."""
    start = {part: T_world @ T for part, T in scene.start.items()}
    return Scene(scene.assembly, start, T_world @ scene.nominal_poses)


def shown(scene: Scene, human_error_scale: Array | None = None) -> Demonstration:
    """A demonstration that shows the true goals."""
    n = len(scene.assembly)
    final = compute_placements(scene.assembly, scene.start, scene.nominal_poses)[-1]
    added = np.zeros((n, 6, 6)) if human_error_scale is None else human_error_scale
    return Demonstration(scene.assembly, scene.start, scene.nominal_poses, final, added)


def seen(scene: Scene, goals: Array) -> Observation:
    """An observation of these goals, all seen, at 1 mm and 1 degree."""
    n = len(scene.assembly)
    covariance = np.tile(np.diag(np.repeat([1e-3, np.radians(1.0)], 3) ** 2), (n, 1, 1))
    return Observation(scene.assembly, scene.start, goals, covariance, np.ones(n, dtype=np.bool_))
