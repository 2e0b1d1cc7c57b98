"""Parts at their final poses become a scenario that is loaded, in an order that can be carried out."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from apo_bench import InputError, Scenario, load_scenario
from apo_bench.geometry import pose
from apo_bench.importers.assembly.new_scenario import new_scenario
from apo_bench.importers.assembly.posed_parts import PosedPart, place_on_table
from apo_bench.importers.assembly.scenario_writer import write_scenario
from apo_bench.scenario.parts import load_part
from apo_bench.scenario.parts.making import (
    Body,
    bore,
    extrude,
    join,
    make_polygon,
    make_rectangle,
    make_shaft,
    write_part,
)


def made(folder: Path, bodies: dict[str, Body], places: dict[str, tuple[str, np.ndarray]]) -> tuple[PosedPart, ...]:
    """Part files, and copies of them at poses."""
    for name, body in bodies.items():
        write_part(name, body, folder, density=700, source="a test", licence="CC0-1.0")
    solids = {name: load_part(folder / f"{name}.xml") for name in bodies}
    return tuple(PosedPart(name, folder / f"{part}.xml", solids[part], T) for name, (part, T) in places.items())


def at(x: float, y: float, z: float, *turn: float) -> np.ndarray:
    return pose.at(1e-3 * np.array([x, y, z]), turn or (0, 0, 0))


def plate(thick: float, radius: float) -> Body:
    bores = [bore((x, 0), radius, 0, thick, f"bore_{i}") for i, x in enumerate((-25, 25), start=1)]
    return extrude(make_rectangle(80, 50), 0, thick, bores=bores, bottom="bottom", top="top")


PIN = make_shaft(4, 0, 40, "side", bottom="tip", top="head")


def covered(folder: Path, off_mm: float) -> tuple[PosedPart, ...]:
    """A plate, two pins through it, a cover over both; every part but the plate is off by so much."""
    T = at(off_mm, -off_mm, off_mm, 0.0, 0.0, off_mm)
    places = {
        "cover": ("cover", at(0, 0, 15) @ T),
        "pin_1": ("pin", at(-25, 0, 0) @ T),
        "pin_2": ("pin", at(25, 0, 0) @ T),
        "plate": ("plate", at(0, 0, 0)),
    }
    return made(folder, {"plate": plate(15, 4.2), "pin": PIN, "cover": plate(10, 4.3)}, places)


def loaded(parts: tuple[PosedPart, ...], folder: Path, *fixed: str) -> Scenario:
    path = folder / "own.toml"
    write_scenario(new_scenario(place_on_table(parts), fixed), path, "own", "a test")
    return load_scenario(path)


def test_contacts_order_and_starts_are_found_and_poses_closed(tmp_path: Path) -> None:
    scenario = loaded(covered(tmp_path, off_mm=0.02), tmp_path)
    assert scenario.assembly.fixed == {"table", "plate"}
    assert scenario.follows_site == {"plate"}
    moved = [operation.main for operation in scenario.assembly.operations]
    assert set(moved[:2]) == {"pin_1", "pin_2"}
    assert moved[2:] == ["cover"]
    contacts = {str(contact) for contact in scenario.assembly.operations[2].contacts}
    assert contacts == {"cover.bottom on plate.top", "cover.bore_1 on pin_1.side", "cover.bore_2 on pin_2.side"}
    assert all(attach.direction @ (0, 0, -1) > 0.99 for attach in scenario.attach)
    waits = [scenario.start[part][:2, 3] for part in moved]
    assert min(np.linalg.norm(a - b) for i, a in enumerate(waits) for b in waits[:i]) > 0.06


def test_the_order_is_as_asked_where_that_can_be(tmp_path: Path) -> None:
    parts = place_on_table(covered(tmp_path, off_mm=0.0))
    for asked in (("pin_1", "pin_2", "cover"), ("pin_2", "pin_1", "cover")):
        assert tuple(placing.moves[0] for placing in new_scenario(parts, wanted_order=asked).order) == asked
    for wrong in (("pin_1", "cover"), ("pin_1", "pin_2", "lid")):
        with pytest.raises(InputError, match=r"in the order .* cannot be put together; .*cover.* can be"):
            new_scenario(parts, wanted_order=wrong)


def test_what_is_blocked_where_it_goes_is_put_together_beside_the_assembly(tmp_path: Path) -> None:
    """A bar in the window of a frame, which stands between two walls that close the window."""
    window = make_rectangle(30.5, 16.5, (0, 25), names=("low", "right", "high", "left"))
    frame = extrude(make_rectangle(60, 60, (0, 30)), -15, 15, holes=[window]).moved(turn_deg=(90, 0, 0))
    floor = extrude(make_rectangle(80, 90), 0, 10, bottom="bottom")
    walls = [extrude(make_rectangle(80, 20, (0, 30 * s)), 10, 60) for s in (-1, 1)]
    bar = extrude(make_rectangle(30, 28), 0, 16, bottom="bottom", top="top")
    parts = made(
        tmp_path,
        {"channel": join(floor, *walls), "frame": frame, "bar": bar},
        {
            "channel": ("channel", at(0, 0, 0)),
            "frame": ("frame", at(0, 0, 10)),
            "bar": ("bar", at(0, 0, 10 + 25 - 8.25)),
        },
    )
    scenario = loaded(parts, tmp_path)
    assert [(operation.main, operation.carries) for operation in scenario.assembly.operations] == [
        ("frame", ()),
        ("bar", ()),
        ("frame", ("bar",)),
    ]
    assert abs(scenario.attach[1].direction[2]) < 0.1


def test_a_press_fit_and_a_part_that_must_be_turned_over_are_named(tmp_path: Path) -> None:
    tight = made(
        tmp_path, {"plate": plate(15, 4.0), "pin": PIN}, {"plate": ("plate", at(0, 0, 0)), "pin": ("pin", at(25, 0, 0))}
    )
    with pytest.raises(RuntimeError, match="a press fit or a thread"):
        new_scenario(place_on_table(tight))
    thin = make_shaft(1.5, 0, 90, "side", bottom="tip", top="head")
    hole = extrude(make_rectangle(60, 60), 0, 20, bores=[bore((0, 0), 1.7, 0, 20, "bore")], bottom="bottom", top="top")
    tall = made(
        tmp_path, {"plate": hole, "thin": thin}, {"plate": ("plate", at(0, 0, 0)), "thin": ("thin", at(0, 0, 0))}
    )
    notes = new_scenario(place_on_table(tall)).notes
    assert any("'thin' starts in a fixture" in note for note in notes)


def test_grasps_keep_clear_of_what_stands_beside_a_goal_or_it_is_said(tmp_path: Path) -> None:
    floor = extrude(make_rectangle(90, 60), 0, 10, bottom="bottom", top="top")
    cube = extrude(make_rectangle(20, 20), 0, 30, bottom="bottom", top="top")
    places = {"floor": ("floor", at(0, 0, 0)), "left": ("cube", at(-15, 0, 10)), "right": ("cube", at(15, 0, 10))}
    found = new_scenario(place_on_table(made(tmp_path, {"floor": floor, "cube": cube}, places)))
    last = found.grasps[found.order[-1].moves[0]]
    assert last is not None
    assert abs(last.across[1]) == pytest.approx(1.0)

    slot = make_polygon((-30, 0), (30, 0), (30, 20), (10, 20), (10, 8), (-10, 8), (-10, 20), (-30, 20))
    rail = extrude(slot, -25, 25, bottom="front", top="back").moved(turn_deg=(90, 0, 0))
    key = extrude(make_rectangle(19.4, 50), 0, 20, bottom="bottom", top="top")
    flush = {"rail": ("rail", at(0, 0, 0)), "key": ("key", at(0, 0, 8))}
    (grasp,) = loaded(made(tmp_path, {"rail": rail, "key": key}, flush), tmp_path).grasps
    assert abs(grasp.across[0]) == pytest.approx(1.0)  # across its ends, fingers would go down flush with the rail's
    assert grasp.point[2] - 0.010 > 0.012  # and else they would stand on its walls
    hole = extrude(make_rectangle(60, 60), 0, 20, holes=[make_rectangle(21, 21)], bottom="bottom", top="top")
    low = extrude(make_rectangle(20, 20), 0, 20, bottom="bottom", top="top")
    sunk = {"hole": ("hole", at(0, 0, 0)), "low": ("low", at(0, 0, 0))}
    assert any(
        "stand out higher" in note
        for note in new_scenario(place_on_table(made(tmp_path, {"hole": hole, "low": low}, sunk))).notes
    )


def test_what_would_tip_over_has_no_order(tmp_path: Path) -> None:
    base = extrude(make_rectangle(60, 60), 0, 20, bottom="bottom", top="top")
    bar = extrude(make_rectangle(100, 20), 0, 10, bottom="bottom", top="top")
    places = {"base": ("base", at(0, 0, 0)), "bar": ("bar", at(45, 0, 20))}
    with pytest.raises(RuntimeError, match="'bar' would not keep its balance on base"):
        new_scenario(place_on_table(made(tmp_path, {"base": base, "bar": bar}, places)))
