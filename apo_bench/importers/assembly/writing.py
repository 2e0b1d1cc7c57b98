"""A draft as the text of a scenario file, with a comment for each choice; and what was chosen, in lines."""

import json
import os
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from apo_bench.assembly import Contact
from apo_bench.geometry import Array, Solid, pose
from apo_bench.importers.assembly.draft import Draft
from apo_bench.importers.assembly.nests import nest_xml
from apo_bench.importers.assembly.ordering import Placing
from apo_bench.importers.assembly.posed import TABLE, PosedPart
from apo_bench.io import clean, write_file
from apo_bench.records import Thresholds
from apo_bench.scenario.parts import part_names, part_path
from apo_bench.scenario.scenario import Grasp

_WIDTH = 118
_LEVEL = 1e-9
THRESHOLDS = {
    "fit_margin_mm": "gap of parts that fit beyond their play",
    "support_mm": "gap of other contacts",
    "overlap_fraction": "share of the true overlap that must be covered",
    "penetration_mm": "depth of one part in another",
    "displaced_mm": "sliding of a part on another one after both were put down",
    "rest_mm_s": "speed below which a part is at rest",
    "rest_deg_s": "turning speed below which a part is at rest",
    "loose_gap_mm": "gap of the loose verdict",
    "loose_angle_deg": "angle of the loose verdict",
}
"""Thresholds, and what each is of; all as in the scenarios of the package."""


def write_scenario(draft: Draft, path: Path, title: str, source: str) -> None:
    """Write the file, and beside it the part files of nests."""
    for nest in draft.nests.values():
        write_file(_nest_file(path, nest), nest_xml(nest))
    write_file(path, scenario_text(draft, title, source, path))


def _nest_file(path: Path, nest: Solid) -> Path:
    return path.with_name(f"{path.stem}_{nest.name}.xml")


def scenario_text(draft: Draft, title: str, source: str, path: Path) -> str:
    """The text of the file.

    Args:
        source: What the poses were read from, in words.
        path: Of the file; part files are named relative to it.
    """
    lines = [
        f"# Written by `apo-bench scenario new` from {source}. Every choice may be changed; `scenario check` says what",
        "# of it human and robot can do. Lengths in mm, angles in degrees. A goal is the pose of the moved part in the",
        "# frame of the assembly, which [site] puts somewhere on the table; a start is a pose in the world.",
        f"# Up: {draft.up}.",
        *(f"# NOTE: {note}." for note in draft.notes),
        "schema = 1",
        f"title = {json.dumps(title, ensure_ascii=False)}",
        'human = "Puts the parts together in this order."',
        'success = "Every part is where the CAD file has it."',
        f"clearance_mm = {draft.clearance_mm:g}  # room per side of faces that part files mark as fit",
        "gap_mm = 0.1  # below this gap a contact equation counts as solved",
        "",
        f"[parts.{TABLE}]",
        f'file = "{TABLE}"',
        "fixed = true",
    ]
    for each in draft.parts:
        lines += ["", *_part(draft, each, path.parent)]
    for part, nest in draft.nests.items():
        file = json.dumps(_nest_file(path, nest).name, ensure_ascii=False)
        lines += ["", f"[parts.{nest.name}]  # '{part}' waits in it", f"file = {file}", "fixed = true"]
        lines.append(f"start = {_pose(draft.starts[nest.name])}")
    for placing in draft.order:
        lines += ["", *_operation(draft, placing)]
    lines += [
        "",
        "[site]  # each trial puts the assembly elsewhere: in reach, clear of what waits beside it",
        f"center_mm = {_list(1e3 * np.array(draft.site.center_m))}",
        f"spread_mm = {_list(1e3 * np.array(draft.site.spread_m))}",
        f"yaw_deg = {_list(np.degrees(draft.site.yaw_rad))}",
        "",
        "[judge]  # as in the scenarios of the package",
        *(f"{name} = {getattr(Thresholds(), name):g}  # {means}" for name, means in THRESHOLDS.items()),
    ]
    return "\n".join(lines) + "\n"


def draft_lines(draft: Draft) -> Iterator[str]:
    """The choices that were made, and what is to be known."""
    yield f"up: {draft.up}"
    yield f"fixed: {', '.join(draft.fixed)} ({draft.why_fixed})"
    for k, placing in enumerate(draft.order, start=1):
        carried = f" with {', '.join(placing.moves[1:])}" if placing.moves[1:] else ""
        yield f"{k}. {placing.moves[0]}{carried} {placing.why}: {len(placing.contacts)} contacts"
    for note in draft.notes:
        yield f"note: {note}"


def _part(draft: Draft, each: PosedPart, folder: Path) -> Iterator[str]:
    yield f"[parts.{each.name}]" + (f"  # {clean(each.title)}" if each.title else "")
    yield f"file = {json.dumps(_file_key(each.file, folder), ensure_ascii=False)}"
    if each.color is not None:
        yield "color = [" + ", ".join(f"{c:.3g}" for c in each.color) + "]"
    if each.name in draft.fixed:
        yield f"fixed = true  # {draft.why_fixed}"
        yield "follows_site = true  # it stands where the assembly stands"
        yield f"start = {_pose(draft.starts[each.name])}"
    else:
        stance = draft.stances[each.name]
        why = "as in the assembly; it may roll" if stance.rolls else "stands as in the assembly"
        if not stance.stands:
            why = "as in the assembly, in its nest"
        yield f"start = {_pose(draft.starts[each.name])}  # {why}"
    if each.fit:
        yield f"[parts.{each.name}.fit]  # faces that recede by the clearance, from so many mm inside of the file's"
        yield from (f"{face} = {inside_mm:g}" for face, inside_mm in each.fit.items())


def _operation(draft: Draft, placing: Placing) -> Iterator[str]:
    main = placing.moves[0]
    yield f"[[operations]]  # {placing.why}"
    yield f'move = "{main}"'
    if placing.moves[1:]:
        yield "carries = [" + ", ".join(f'"{part}"' for part in placing.moves[1:]) + "]  # they hold together"
    yield f"goal = {_pose(placing.at)}"
    yield from _contacts(placing.contacts, main)
    yield from _grasp(draft.grasps[main], main, draft)


def _contacts(contacts: Sequence[Contact], main: str) -> Iterator[str]:
    pairs = [f'["{m.face if m.part == main else m}", "{e}"]' for m, e in contacts]
    line = f"contacts = [{', '.join(pairs)}]"
    yield from [line] if len(line) <= _WIDTH else ["contacts = [", *(f"    {pair}," for pair in pairs), "]"]


def _grasp(hold: Grasp | None, main: str, draft: Draft) -> Iterator[str]:
    solid = next(each.solid for each in draft.parts if each.name == main)
    low, high = solid.bounds
    if hold is None:
        # Level directions of the world in the frame of the part: across the narrower one, at the middle.
        level = draft.starts[main][:2, :3]
        across = level[int(np.argmin(np.ptp(solid.bounds @ level.T, axis=0)))]
        at = np.clip(solid.centroid, low, high)
        yield f"grasp = {{ at_mm = {_list(1e3 * at)}, across = {_axis(across)} }}  # NO PLACE for the gripper"
        return
    wide = f"{2e3 * (hold.half_width or 0.0):.4g} mm between the fingers"
    ahead = "" if hold.ahead is None else f", ahead = {_axis(hold.ahead)}"
    if hold.ahead is not None:
        wide += ", of a hand that is tilted"
    elif ((hold.point < low - _LEVEL) | (hold.point > high + _LEVEL)).any():
        wide += ", whose tips end above the part"
    yield f"grasp = {{ at_mm = {_list(1e3 * hold.point)}, across = {_axis(hold.across)}{ahead} }}  # {wide}"


def _file_key(file: Path, folder: Path) -> str:
    """How a scenario in a folder names a part file."""
    is_own = file.stem in part_names() and part_path(file.stem) == file
    return file.stem if is_own else Path(os.path.relpath(file, folder)).as_posix()


def _pose(T: Array) -> str:
    turn = pose.turn_deg(T)
    turned = f", turn_deg = {_list(turn)}" if np.abs(turn).max() > 0.0 else ""
    return f"{{ at_mm = {_list(1e3 * T[:3, 3])}{turned} }}"


def _axis(axis: Array) -> str:
    along = int(np.abs(axis).argmax())
    return f'"{"xyz"[along]}"' if abs(axis[along]) > 1.0 - 1e-12 else _list(axis)


def _list(values: Array) -> str:
    """Without digits below a nanometre."""
    return "[" + ", ".join(f"{round(float(x), 8) + 0.0:.12g}" for x in values) + "]"
