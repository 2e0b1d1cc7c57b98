"""Scenes of parts with round and tilted faces: tests compare with these."""

from __future__ import annotations

from dataclasses import fields

import numpy as np

from apo_bench import Scenario, load_scenario
from apo_bench.assembly import Operation
from apo_bench.geometry import measure_world_bounds
from tests.round_parts import bush, countersunk, peg, plate, plug, rail, slider, v_block, wedge
from tests.scenes import Scene, mm, scene, table, touch


def peg_in_plate() -> Scene:
    """A peg of 10 mm stands in a plate, on the table."""
    operations = [
        Operation("plate", touch("plate", "table", "bottom-top")),
        Operation("peg", touch("peg", "plate", "wall-bore") + touch("peg", "table", "end-top")),
    ]
    return scene([table(), plate(), peg()], operations, [mm(0, 0, 0), mm(0, 0, 0)])


def loose_peg() -> Scene:
    """The same with a thinner peg and no face that is fit: 0.1 mm of play by their sizes."""
    operations = peg_in_plate().assembly.operations
    return scene([table(), plate(fit=False), peg(radius=4.9)], operations, [mm(0, 0, 0), mm(0, 0, 0)])


def nested() -> Scene:
    """A bush in the hole of a plate, a shaft in the bush."""
    operations = [
        Operation("plate", touch("plate", "table", "bottom-top")),
        Operation("bush", touch("bush", "plate", "wall-bore") + touch("bush", "table", "bottom-top")),
        Operation("peg", touch("peg", "bush", "wall-bore") + touch("peg", "table", "end-top")),
    ]
    return scene([table(), plate(radius=12.0), bush(), peg()], operations, [mm(0, 0, 0)] * 3)


def through() -> Scene:
    """Example 5.1 with round faces: two plates stand on edge, a shaft goes through both."""
    operations = [
        Operation("a", touch("a", "table", "ny-top")),
        Operation("b", touch("b", "table", "ny-top")),
        Operation("peg", touch("peg", "a", "wall-bore") + touch("peg", "b", "wall-bore")),
    ]
    solids = [table(), plate("a"), plate("b"), peg(length=120.0)]
    goals = [mm(0, -20, 30, (90, 0, 0)), mm(0, 40, 30, (90, 0, 0)), mm(0, 60, 30, (90, 0, 0))]
    return scene(solids, operations, goals)


def in_groove() -> Scene:
    """A shaft lies in a groove of 90 degrees."""
    operations = [
        Operation("v", touch("v", "table", "bottom-top")),
        Operation("peg", touch("peg", "v", "wall-left", "wall-right")),
    ]
    height = 20.0 + 5.0 * np.sqrt(2.0)
    return scene([table(), v_block(), peg()], operations, [mm(0, 0, 0), mm(-25, 0, height, (0, 90, 0))])


def on_table() -> Scene:
    """A shaft lies on the table, and a block leans on nothing: the least there is."""
    return scene([table(), peg()], [Operation("peg", touch("peg", "table", "wall-top"))], [mm(0, 0, 5, (0, 90, 0))])


def countersink() -> Scene:
    """A plug with a cone of 45 degrees in its seat."""
    operations = [
        Operation("plate", touch("plate", "table", "bottom-top")),
        Operation("plug", touch("plug", "plate", "cone-sink")),
    ]
    return scene([table(), countersunk(), plug()], operations, [mm(0, 0, 0), mm(0, 0, 14)])


def on_rim() -> Scene:
    """The same plug on the rim of a hole of 5 mm."""
    operations = [
        Operation("plate", touch("plate", "table", "bottom-top")),
        Operation("plug", touch("plug", "plate", "cone-rim")),
    ]
    return scene([table(), plate(), plug()], operations, [mm(0, 0, 0), mm(0, 0, 18)])


def wedges_meet() -> Scene:
    """A wedge lies on another one, upside down: their slopes meet, the upper one is level again."""
    rise = 60.0 * np.tan(np.radians(30.0))
    operations = [
        Operation("low", touch("low", "table", "bottom-top")),
        Operation("high", touch("high", "low", "slope-slope")),
    ]
    goals = [mm(0, 0, 0), mm(0, 0, 20 + rise, (180, 0, 0))]
    return scene([table(), wedge("low"), wedge("high")], operations, goals)


def dovetail() -> Scene:
    """A slider on a rail, with walls at 60 degrees that hold it down."""
    operations = [
        Operation("rail", touch("rail", "table", "bottom-top")),
        Operation("slider", touch("slider", "rail", "left-left", "right-right", "ceiling-top")),
    ]
    return scene([table(), rail(), slider()], operations, [mm(0, 0, 0), mm(0, 0, 0)])


ALL = {
    "peg_in_plate": peg_in_plate,
    "loose_peg": loose_peg,
    "nested": nested,
    "through": through,
    "in_groove": in_groove,
    "on_table": on_table,
    "countersink": countersink,
    "on_rim": on_rim,
    "wedges_meet": wedges_meet,
    "dovetail": dovetail,
}


def as_scenario(of: Scene, **changes: object) -> Scenario:
    """A scene as a scenario: every part starts somewhere apart on the table, turned as its first goal is."""
    first = {operation.main: k for k, operation in reversed(list(enumerate(of.assembly.operations)))}
    start = dict(of.start)
    for i, (part, k) in enumerate(sorted(first.items())):
        T = np.array(of.nominal_poses[k])
        low, _ = measure_world_bounds([(of.assembly.solids[part], T)])
        T[:3, 3] += (0.2 * i - 0.5, 0.45, -low[2]) - T[:3, 3] * (1, 1, 0)
        start[part] = T
    n = len(of.assembly)
    given = load_scenario("stick_on_castles")
    values = {field.name: getattr(given, field.name) for field in fields(Scenario)}
    values |= {
        "assembly": of.assembly,
        "start": start,
        "nominal_poses": of.nominal_poses,
        "part_files": {},
        "colors": {},
        "human_error": None,
    }
    values |= {"attach": given.attach[:1] * n, "grasps": given.grasps[:1] * n, "shifts": ()}
    return Scenario(**(values | changes))
