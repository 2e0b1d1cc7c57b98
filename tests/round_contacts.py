"""Small parts with round faces, and assemblies of two or three operations in which each kind of contact occurs."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from scipy.spatial.transform import Rotation

from apo_bench import Assembly, Observation
from apo_bench.assembly import Contact, Gap, Operation, PartFace
from apo_bench.geometry import Box, Cylinder, Face, Hull, Piece, RoundFace, Solid, count_sides, make_cylinder_hull, pose

Z = np.array([0.0, 0.0, 1.0])
MM = 1e-3


def square(name: str, at: float, half: float, up: bool = True) -> Face:
    """A square across z, looking up or down."""
    corners = np.array([[-half, -half, at], [half, -half, at], [half, half, at], [-half, half, at]])
    return Face(name, corners if up else corners[::-1])


def ring(name: str, at: float, radius: float, up: bool) -> Face:
    """A disc across z as a polygon of many corners."""
    turns = 2.0 * np.pi * np.arange(32) / 32
    corners = np.column_stack([radius * np.cos(turns), radius * np.sin(turns), np.full(32, at)])
    return Face(name, corners if up else corners[::-1])


def wall(
    name: str, low: float, high: float, radii: float | tuple[float, float], hole: bool, fit: bool = False
) -> RoundFace:
    """A face of revolution about the z axis."""
    both = radii if isinstance(radii, tuple) else (radii, radii)
    return RoundFace(name, np.zeros(3), Z, (low, high), both, hole, fit)


def tube(outer: float, inner: float, low: float, high: float, sides: int | None = None) -> tuple[Hull, ...]:
    """What is between two circles, as prisms whose inner sides touch the smaller one."""
    n = sides or count_sides(inner)
    found = []
    for i in range(n):
        turn = 2.0 * np.pi * (i + np.array([-0.5, 0.5])) / n
        way = np.column_stack([np.cos(turn), np.sin(turn)])
        flat = np.concatenate([inner / np.cos(np.pi / n) * way, outer * way])
        found.append(Hull(f"w{i}", np.concatenate([np.column_stack([flat, np.full(4, z)]) for z in (low, high)])))
    return tuple(found)


def part(
    name: str, pieces: tuple[Piece, ...], flats: tuple[Face, ...] = (), rounds: tuple[RoundFace, ...] = ()
) -> Solid:
    """A part whose centre of volume is in the middle of its pieces."""
    middle = np.mean([piece.center for piece in pieces], axis=0)
    return Solid(name, {f.name: f for f in flats}, pieces, middle, 1e-6, {f.name: f for f in rounds})


def plate(fit: bool = False, radius: float = 5 * MM) -> Solid:
    """40 x 40 x 20 mm with a bore, a countersink and the rim of the bore; its top is at z = 20 mm."""
    flats = (square("bottom", 0.0, 20 * MM, up=False), square("top", 20 * MM, 20 * MM))
    rounds = (
        wall("bore", 0.0, 20 * MM, radius, True, fit),
        wall("sink", 18 * MM, 20 * MM, (radius, radius + 2 * MM), True),
        wall("rim", 20 * MM, 20 * MM, radius, True),
    )
    return part("plate", tube(20 * MM, radius, 0.0, 20 * MM), flats, rounds)


def pin(radius: float = 5 * MM) -> Solid:
    """50 mm long along z, with a shoulder face in its middle and cones at its lower end."""
    shaft = make_cylinder_hull("shaft", Cylinder(25 * MM * Z, Z, radius, 25 * MM))
    flats = (ring("bottom", 0.0, radius, up=False), ring("top", 50 * MM, radius, up=True))
    rounds = (
        wall("shaft", 0.0, 50 * MM, radius, False),
        wall("taper", 30 * MM, 40 * MM, (radius, radius + 10 * MM), False),
        wall("lower", 0.0, 20 * MM, radius, False),
    )
    return part("pin", (shaft,), flats, rounds)


def table() -> Solid:
    return part(
        "table", (Box("slab", np.array([0, 0, -0.01]), np.array([0.3, 0.3, 0.01])),), (square("top", 0.0, 0.3),)
    )


def tilted(at: tuple[float, float, float], turn: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> np.ndarray:
    """A pose, mm and degrees."""
    T = np.eye(4)
    T[:3, :3] = Rotation.from_euler("xyz", turn, degrees=True).as_matrix()
    T[:3, 3] = np.array(at) * MM
    return T


def touching(a: str, b: str) -> Contact:
    """`pin.shaft` on `plate.bore`."""
    return Contact(*(PartFace(*of.split(".")) for of in (a, b)))


PLATE_AT = tilted((30.0, 20.0, 0.0), (0.0, 0.0, 25.0))
IN_BORE = PLATE_AT @ tilted((0.0, 0.0, 3.0), (0.0, 0.0, 70.0))
LYING = tilted((-60.0, 10.0, 5.0), (0.0, 90.0, 20.0))
CONTACTS: Mapping[str, tuple[Contact, np.ndarray, int]] = {
    "shaft in hole": (touching("pin.shaft", "plate.bore"), IN_BORE, 4),
    "shaft on plane": (touching("pin.shaft", "table.top"), LYING, 2),
    "cone in cone": (touching("pin.taper", "plate.sink"), PLATE_AT @ tilted((0.0, 0.0, -12.0), (0.0, 0.0, 70.0)), 5),
    "cone on rim": (touching("pin.taper", "plate.rim"), PLATE_AT @ tilted((0.0, 0.0, -10.0), (0.0, 0.0, 70.0)), 3),
}
"""Kind -> the contact, where the pin then is, how many directions it fixes (by hand)."""


def scene(
    *contacts: Contact,
    at: np.ndarray,
    fit: bool = False,
    gaps: Mapping[Contact, Gap] | None = None,
    radius: float = 5 * MM,
) -> tuple[Assembly, dict[str, np.ndarray], np.ndarray]:
    """The plate is put on the table, then the pin where it is; assembly, start poses and true goals."""
    on_table = touching("plate.bottom", "table.top")
    assembly = Assembly(
        {"table": table(), "plate": plate(fit, radius), "pin": pin()},
        (Operation("plate", (on_table,)), Operation("pin", tuple(contacts))),
        frozenset({"table"}),
        gaps or {},
    )
    start = {"table": np.eye(4), "plate": tilted((200.0, 0.0, 0.0)), "pin": tilted((0.0, 200.0, 0.0))}
    return assembly, start, np.array([PLATE_AT, at])


def seen(
    assembly: Assembly,
    start: Mapping[str, np.ndarray],
    truth: np.ndarray,
    rng: np.random.Generator,
    mm: float = 1.0,
    deg: float = 1.0,
    play_m: float = 0.0,
) -> Observation:
    """What is seen with Gaussian noise; goals are wrong by exp(xi), xi in their own frames."""
    sigma = np.repeat([mm * MM, np.radians(deg)], 3)
    xi = rng.standard_normal((len(truth), 6)) * sigma
    covariance = np.tile(np.diag(sigma**2), (len(truth), 1, 1))
    goals = truth @ pose.inverse(pose.exp(xi))
    return Observation(assembly, start, goals, covariance, np.ones(len(truth), dtype=bool), play_m=play_m)
