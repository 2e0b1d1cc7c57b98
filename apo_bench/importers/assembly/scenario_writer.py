"""Write a new scenario to a TOML file with a comment on each choice."""

import json
import os
from collections.abc import Iterable, Iterator
from pathlib import Path

import numpy as np

from apo_bench.geometry import Array, Solid, pose
from apo_bench.importers.assembly.fixtures import fixture_xml
from apo_bench.importers.assembly.new_scenario import NewScenario
from apo_bench.importers.assembly.order_search import Placement
from apo_bench.importers.assembly.posed_parts import TABLE, PosedPart
from apo_bench.io import clean, write_file
from apo_bench.records import Thresholds
from apo_bench.scenario.parts import find_part_path, list_part_names

_WIDTH = 118  # longest line of contacts
_DIGITS = 8  # decimals of lengths in mm, angles in degrees and axes
THRESHOLDS = {
    "fit_margin_mm": "gap of parts that fit beyond their play",
    "support_mm": "gap of other contacts",
    "overlap_fraction": "share of the true overlap that must be covered",
    "penetration_mm": "depth of one part in another",
    "placed_part_shift_mm": "sliding of a part on another one after both were put down",
    "rest_mm_s": "speed below which a part is at rest",
    "rest_deg_s": "turning speed below which a part is at rest",
    "loose_gap_mm": "gap of the loose verdict",
    "loose_angle_deg": "angle of the loose verdict",
}
"""Threshold -> its meaning, for comments; values are the defaults of the packaged scenarios."""


def write_scenario(new: NewScenario, path: Path, title: str, source: str) -> None:
    """Write the scenario file, and the part files of its fixtures next to it.

    Args:
        title, source: As in `format_scenario`.
    """
    for fixture in new.fixtures.values():
        write_file(_fixture_file(path, fixture), fixture_xml(fixture))
    write_file(path, format_scenario(new, title, source, path))


def _fixture_file(path: Path, fixture: Solid) -> Path:
    """Return the path of the part file of a fixture, next to the scenario file."""
    return path.with_name(f"{path.stem}_{fixture.name}.xml")


def format_scenario(new: NewScenario, title: str, source: str, path: Path) -> str:
    """Return the text of the scenario file.

    Args:
        source: Names of the files of the poses, for the header.
        path: Path of the scenario file; part files are named relative to its folder.
    """
    lines = [
        f"# Written by `apo-bench scenario new` from {source}. `scenario check` tests every change of this file.",
        "# Lengths in mm, angles in degrees. A goal is the pose of the moved part in the frame of the assembly, which",
        "# [site] puts somewhere on the table; a start is a pose in the world.",
        f"# Up: {new.up}.",
        *(f"# NOTE: {note}." for note in new.notes),
        "schema = 1",
        f"title = {_quote(title)}",
        'human = "Puts the parts together in this order."',
        'success = "Every part is where the CAD file has it."',
        f"clearance_mm = {new.clearance_mm:g}  # room per side of faces that part files mark as fit",
        "gap_mm = 0.1  # below this gap a contact equation counts as solved",
        *("", f"[parts.{TABLE}]", f'file = "{TABLE}"', "fixed = true"),
    ]
    for each in new.parts:
        lines += ["", *_list_part_lines(new, each, path.parent)]
    for part, fixture in new.fixtures.items():
        lines += ["", f"[parts.{fixture.name}]  # '{part}' starts in it"]
        lines += [f"file = {_quote(_fixture_file(path, fixture).name)}", "fixed = true"]
        lines.append(f"start = {_format_pose(new.starts[fixture.name])}")
    for placing in new.order:
        lines += ["", *_list_operation_lines(new, placing)]
    lines += [
        "",
        "[site]  # each trial puts the assembly elsewhere: in reach, clear of the parts that start beside it",
        f"center_mm = {_format_list(1e3 * np.array(new.site.center_m))}",
        f"spread_mm = {_format_list(1e3 * np.array(new.site.spread_m))}",
        f"yaw_deg = {_format_list(np.degrees(new.site.yaw_rad))}",
        "",
        "[judge]  # as in the scenarios of the package",
        *(f"{name} = {getattr(Thresholds(), name):g}  # {means}" for name, means in THRESHOLDS.items()),
    ]
    return "\n".join(lines) + "\n"


def list_choices(new: NewScenario) -> Iterator[str]:
    """Yield the choices of the import and its notes as lines for the terminal."""
    yield f"up: {new.up}"
    yield f"fixed: {', '.join(new.fixed)} ({new.why_fixed})"
    for k, placing in enumerate(new.order, start=1):
        carried = f" with {', '.join(placing.moves[1:])}" if placing.moves[1:] else ""
        clamped = ", clamped there" if placing.clamped else ""
        yield f"{k}. {placing.moves[0]}{carried} {placing.why}{clamped}: {len(placing.contacts)} contacts"
    yield from (f"note: {note}" for note in new.notes)


def _list_part_lines(new: NewScenario, each: PosedPart, folder: Path) -> Iterator[str]:
    """Yield the lines of the tables of one part: file, color, start and faces that fit.

    Args:
        folder: The folder of the scenario file.
    """
    yield f"[parts.{each.name}]" + (f"  # {clean(each.title)}" if each.title else "")
    is_packaged = each.file.stem in list_part_names() and find_part_path(each.file.stem) == each.file
    file = each.file.stem if is_packaged else Path(os.path.relpath(each.file, folder)).as_posix()
    yield f"file = {_quote(file)}"
    if each.color is not None:
        yield f"color = {_format_list(np.round(each.color, 3))}"
    if each.name in new.fixed:
        yield f"fixed = true  # {new.why_fixed}"
        yield "follows_site = true  # it stands where the assembly stands"
    yield f"start = {_format_pose(new.starts[each.name])}"
    if each.fit:
        yield f"[parts.{each.name}.fit]  # faces that recede by the clearance, from this depth inside of the file's, mm"
        yield from (f"{face} = {inside_mm:g}" for face, inside_mm in each.fit.items())


def _list_operation_lines(new: NewScenario, placing: Placement) -> Iterator[str]:
    """Yield the lines of one operation: moved parts, goal, contacts and grasp."""
    main = placing.moves[0]
    yield f"[[operations]]  # {placing.why}"
    yield f'move = "{main}"'
    if placing.moves[1:]:
        yield "carries = [" + ", ".join(f'"{part}"' for part in placing.moves[1:]) + "]"
    yield f"goal = {_format_pose(placing.at)}"
    pairs = [f'["{m.face if m.part == main else m}", "{e}"]' for m, e in placing.contacts]
    line = f"contacts = [{', '.join(pairs)}]"
    if placing.along is not None:
        yield f"attach = {{ along = {_format_list(placing.along)} }}"
    if placing.clamped:
        yield "clamp = true  # a fastener that is no part holds it: it is fixed here once it presses on its seat"
    yield from [line] if len(line) <= _WIDTH else ["contacts = [", *(f"    {pair}," for pair in pairs), "]"]
    hold = new.grasps[main]
    if hold is not None:
        wide = f"{2e3 * (hold.half_width or 0.0):.4g} mm between the fingers"
        yield f"grasp = {{ at_mm = {_format_list(1e3 * hold.point)}, across = {_format_axis(hold.across)} }}  # {wide}"
        return
    # No grasp was found: write one at the centre of mass, across the narrower horizontal side, for a person to edit.
    solid = next(each.solid for each in new.parts if each.name == main)
    level = new.starts[main][:2, :3]
    across = level[int(np.argmin(np.ptp(solid.bounds @ level.T, axis=0)))]
    at = np.clip(solid.centroid, *solid.bounds)
    yield f"grasp = {{ at_mm = {_format_list(1e3 * at)}, across = {_format_axis(across)} }}  # NO PLACE for the gripper"


def _quote(text: str) -> str:
    """Return a TOML string."""
    return json.dumps(text, ensure_ascii=False)


def _format_pose(T: Array) -> str:
    """Return the TOML table of a pose (4, 4), [m]: position in mm, rotation in degrees if there is any."""
    turn = pose.turn_deg(T)
    turned = f", turn_deg = {_format_list(turn)}" if np.abs(turn).max() > 0.0 else ""
    return f"{{ at_mm = {_format_list(1e3 * T[:3, 3])}{turned} }}"


def _format_axis(axis: Array) -> str:
    """Return an axis, (3,), as its letter if it is along x, y or z to all digits, otherwise as a list."""
    along = int(np.abs(axis).argmax())
    return f'"{"xyz"[along]}"' if np.count_nonzero(np.round(axis, _DIGITS)) == 1 else _format_list(axis)


def _format_list(values: Iterable[float]) -> str:
    """Return a TOML list of numbers, rounded to hide rounding errors."""
    return "[" + ", ".join(f"{round(float(x), _DIGITS) + 0.0:.12g}" for x in values) + "]"
