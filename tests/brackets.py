"""An L bracket over two pins, and a wedge under a tilted roof: scenes with round and tilted faces."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from apo_bench.assembly import Operation
from apo_bench.geometry import Box, Cylinder, Face, Hull, RoundFace, Solid, make_cylinder_hull, pose
from tests import round_parts
from tests.scenes import Scene, box_faces, mm, scene, table, touch

Z = np.array([0.0, 0.0, 1.0])


def pins() -> Solid:
    """A base of 100 x 40 x 10 mm with two pins of 8 mm that are 30 mm high and end in chamfers; frame: its bottom."""
    found = [Box("base", 0.005 * Z, np.array([0.05, 0.02, 0.005]))]
    walls = {}
    for name, x in (("a", -0.03), ("b", 0.03)):
        at = np.array([x, 0.0, 0.0])
        walls[f"{name}_pin"] = RoundFace(f"{name}_pin", at, Z, (0.01, 0.039), (0.004, 0.004), False)
        walls[f"{name}_tip"] = RoundFace(f"{name}_tip", at, Z, (0.039, 0.04), (0.004, 0.003), False)
        found.append(make_cylinder_hull(f"{name}_pin", Cylinder(at + 0.0245 * Z, Z, 0.004, 0.0145)))
        tip = np.concatenate([round_parts.ring(4, 39), round_parts.ring(3, 40)])
        found.append(Hull(f"{name}_tip", at + tip))
    flat = {face.name: face for face in box_faces((50, 20, 10))}
    faces = {"top": replace(flat["pz"], name="top"), "bottom": _lifted(flat["nz"])}
    return Solid("pins", faces, tuple(found), 0.01 * Z, 4e-5, walls)


def _lifted(face: Face) -> Face:
    return replace(face, name="bottom", outline=face.outline + 0.01 * Z)


def bracket() -> Solid:
    """An L: a plate of 100 x 40 x 10 mm with two bores of 8 mm, and a wall of 60 mm at its back; frame: its bottom."""
    pieces: list[Box | Hull] = [Box("back", np.array([0.0, 0.025, 0.03]), np.array([0.05, 0.005, 0.03]))]
    walls = {}
    for name, x in (("a", -0.03), ("b", 0.03)):
        at = np.array([x, 0.0, 0.0])
        walls[name] = RoundFace(name, at, Z, (0.0, 0.01), (0.004, 0.004), True, fit=True)
        pieces += [Hull(f"{name}{w.name}", w.corners + at) for w in round_parts.bored(4, 20, 10, wide=True)]
    pieces.append(Box("middle", np.array([0.0, 0.0, 0.005]), np.array([0.01, 0.02, 0.005])))
    bottom = _lifted({face.name: face for face in box_faces((50, 20, 10))}["nz"])
    return Solid("bracket", {"bottom": bottom}, tuple(pieces), 0.02 * Z, 1e-4, walls)


def on_pins() -> Scene:
    contacts = touch("bracket", "pins", "a-a_pin", "b-b_pin", "bottom-top")
    operations = [Operation("pins", touch("pins", "table", "bottom-top")), Operation("bracket", contacts)]
    return scene([table(), pins(), bracket()], operations, [mm(0, 0, 0), mm(0, 0, 10)])


def under_roof(angle_deg: float = 30.0) -> Scene:
    """A wedge on the table with its slope under a roof that is tilted as it is."""
    slope = round_parts.wedge("roof", angle_deg)
    turned = pose.exp([0, 0, 0, np.pi, 0, 0]) @ np.eye(4)
    rise = 1e-3 * (20 + 60 * np.tan(np.radians(angle_deg)))
    turned[:3, 3] = [0.0, 0.0, rise]
    contacts = touch("wedge", "table", "bottom-top") + touch("wedge", "roof", "slope-slope")
    made = scene(
        [table(), slope, round_parts.wedge(angle_deg=angle_deg)], [Operation("wedge", contacts)], [mm(0, 0, 0)]
    )
    of = replace(made.assembly, fixed=frozenset({"table", "roof"}))
    return Scene(of, {**made.start, "roof": turned}, made.nominal_poses)
