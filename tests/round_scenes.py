"""Scenarios with round parts, made and put together in code: a peg for a plate with a bore."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from apo_bench import Assembly, Scenario
from apo_bench.assembly import Contact, Operation, PartFace
from apo_bench.geometry import Array, pose
from apo_bench.planning.insertion.attach_line import Preference
from apo_bench.records import Thresholds
from apo_bench.scenario.attach_lines import add_attach_lines
from apo_bench.scenario.parts import find_part_path, load_part
from apo_bench.scenario.parts.making import Body, bore, extrude, make_rectangle, make_shaft, write_part
from apo_bench.scenario.scenario import Grasp, Site

PEG = make_shaft(5, -25, 25, "wall", bottom="bottom", top="top")
PLATE = extrude(
    make_rectangle(60, 60), 0, 20, bores=[bore((0, 0), 5, 0, 20, "bore", fit=True)], bottom="bottom", top="top"
)


def contacts(main: str, *pairs: str) -> tuple[Contact, ...]:
    """Each pair as `bottom-table.top`."""
    split = [pair.split("-") for pair in pairs]
    return tuple(Contact(PartFace(main, own), PartFace(*other.split("."))) for own, other in split)


def scenario(
    folder: Path,
    bodies: Mapping[str, Body],
    operations: Sequence[Operation],
    goals: Sequence[Array],
    start: Mapping[str, Array],
    grasps: Sequence[Grasp],
    density: float = 1000.0,
    friction: float = 0.8,
) -> Scenario:
    """Parts are written into the folder; the table is that of the package."""
    files = {
        name: write_part(
            name,
            body,
            folder,
            density=density,
            friction=(friction, 0.005, 0.0001),
            source="a test",
            licence="Apache-2.0",
        )
        for name, body in bodies.items()
    }
    files = {"table": find_part_path("table"), **files}
    made = Scenario(
        name="round",
        title="",
        paper="",
        human="",
        success="",
        assembly=Assembly({n: load_part(path) for n, path in files.items()}, tuple(operations), frozenset({"table"})),
        part_files=files,
        colors={},
        start={"table": np.eye(4), **start},
        nominal_poses=np.array(goals),
        attach=(),
        grasps=tuple(grasps),
        site=Site((0.1, 0.0), (0.03, 0.03), (-0.3, 0.3)),
        shifts=(),
        human_error=None,
        thresholds=Thresholds(),
        clearance_mm=0.25,
        gap_mm=0.1,
    )
    return add_attach_lines(made, (Preference(),) * len(goals), "round")


def peg_in_hole(folder: Path, off: tuple[float, float] = (0.0, 0.0)) -> Scenario:
    """A plate is put on the table, and a peg of 10 x 50 mm into its bore.

    Args:
        off: How far beside the bore the goal of the peg is, [m].
    """
    operations = [
        Operation("plate", contacts("plate", "bottom-table.top")),
        Operation("peg", contacts("peg", "wall-plate.bore", "bottom-table.top")),
    ]
    goals = [np.eye(4), pose.at((*off, 0.025))]
    start = {"plate": pose.at((0, -0.27, 0)), "peg": pose.at((0, 0.27, 0.025))}
    x = np.array([1.0, 0.0, 0.0])
    grasps = [Grasp(np.array([0.0, 0.02, 0.01]), x), Grasp(np.array([0.0, 0.0, 0.012]), x)]
    return scenario(folder, {"plate": PLATE, "peg": PEG}, operations, goals, start, grasps)
