"""The task sheet of a scenario in Markdown: operations, human error, layout, and success criteria."""

from collections.abc import Iterator
from dataclasses import asdict

import numpy as np

from apo_bench.assembly import Layout, build_relation_graph, compute_joint_play_mm, compute_placements
from apo_bench.geometry import Array
from apo_bench.io import join_words
from apo_bench.judging.finished_assembly import list_fixtures
from apo_bench.records import Thresholds
from apo_bench.scenario import NEGLIGIBLE_M, Scenario, Turn, spread_error
from apo_bench.viz.form_text import format_value


def write_task_sheet(scenario: Scenario, level: int = 1) -> str:
    """Return the task sheet of a scenario in Markdown.

    Args:
        level: Level of the heading, from 1.
    """
    facts = {
        "In the paper": scenario.paper,
        "Parts": ", ".join(_describe_parts(scenario)),
        "Human": scenario.human,
        "Human error": _describe_human_error(scenario),
        "Layout": "; ".join(_describe_variations(scenario)),
        "Success": scenario.success,
        **_describe_verdict(scenario),
    }
    bullets = [f"- {name}: {text.removesuffix('.')}." for name, text in facts.items() if text]
    head = f"{'#' * level} {scenario.name}: {scenario.title}"
    return "\n".join([head, "", *_describe_operations(scenario), "", *bullets]) + "\n"


def _describe_parts(scenario: Scenario) -> Iterator[str]:
    """Yield each part with notes: `table (fixed)`, or `B (block)` if its file has another name."""
    for name, path in scenario.part_files.items():
        notes = ["fixed"] * (name in scenario.assembly.fixed) + [path.stem] * (path.stem != name)
        yield f"{name} ({', '.join(notes)})" if notes else name


def _describe_operations(scenario: Scenario) -> Iterator[str]:
    """Yield a line for each operation: `5. stick: R6 stick -> cube2 (py-hpy, ...), R7 ...; ends R2`."""
    graph = build_relation_graph(scenario.assembly)
    for k, operation in enumerate(scenario.assembly.operations):
        made = ", ".join(f"{arc} ({', '.join(arc.pairs)})" for arc in graph.arcs if arc.made == k)
        ended = ", ".join(arc.name for arc in graph.arcs if arc.lost == k)
        carried = f" with {join_words(operation.carries)}" if operation.carries else ""
        yield f"{k + 1}. {operation.main}{carried}: {made or 'no contact'}{ended and f'; ends {ended}'}"


def _describe_human_error(scenario: Scenario) -> str:
    """Describe the displacement of the human error, and the later operations that it displaces too."""
    error = scenario.human_error
    if error is None:
        return "none"
    # parts placed on a displaced face are displaced as well
    offsets = spread_error(scenario, Layout(scenario.nominal_poses, scenario.start), error.axis).offsets
    mains = [operation.main for operation in scenario.assembly.operations]
    astray = np.flatnonzero(np.linalg.norm(offsets, axis=1) > NEGLIGIBLE_M)  # numbers of operations from 0
    followers = [f"{mains[k]} (operation {k + 1})" for k in astray if k != error.operation]
    follow = f"; {join_words(followers)} {'follows' if len(followers) == 1 else 'follow'}" if followers else ""
    return (
        f"operation {error.operation + 1} displaces {mains[error.operation]} by "
        f"{_format_span(error.low_m, error.high_m)} mm along {_name_axis(error.axis)}{follow}"
    )


def _describe_variations(scenario: Scenario) -> Iterator[str]:
    """Describe how layouts vary: place and rotation of the assembly, then shifts and turns of single operations."""
    site = scenario.site
    x, y = (f"{c * 1e3:g} ± {s * 1e3:g}" for c, s in zip(site.center_m, site.spread_m, strict=True))
    low, high = np.degrees(site.yaw_rad)
    names = [f"operation {k}: {operation.main}" for k, operation in enumerate(scenario.assembly.operations, start=1)]
    yield f"x {x} mm, y {y} mm, turned by {low:g} to {high:g} degrees"
    for shift in scenario.shifts:
        span = _format_span(shift.low_m, shift.high_m)
        yield f"{names[shift.operation]} by {span} mm along {_name_axis(shift.axis)}"
    for turn in scenario.turns:
        degrees = f"{np.degrees(turn.low_rad):g} to {np.degrees(turn.high_rad):g} degrees"
        yield f"{names[turn.operation]} by {degrees} about {_name_axis(turn.axis)}{_format_axis_point(turn)}"


def _describe_verdict(scenario: Scenario) -> dict[str, str]:
    """Describe the criteria of success as far as they differ from the defaults; empty texts are not printed."""
    thresholds = scenario.thresholds
    changed = dict(asdict(thresholds).items() - asdict(Thresholds()).items())
    # in allowed gaps the fit margin is added to the play
    wider = (f"{contact} {play + thresholds.fit_margin_mm:.2f} mm" for contact, play in sorted(_list_wider(scenario)))
    return {
        "Verdict": "as demonstrated" if scenario.success_means == "as_demonstrated" else "",
        "Clearance per side": f"{scenario.clearance_mm:g} mm",
        "Thresholds": format_value(changed) if changed else "",
        "Allowed gaps beyond the clearance": "; ".join(wider),
        "Fixtures": join_words(sorted(list_fixtures(scenario.assembly))),
    }


def _list_wider(scenario: Scenario) -> Iterator[tuple[str, float]]:
    """Yield contacts whose play at the nominal poses is larger than the clearance, with that play [mm]."""
    assembly = scenario.assembly
    history = compute_placements(assembly, scenario.start, scenario.nominal_poses)
    for contact, operation, _ in assembly.relations():
        play = compute_joint_play_mm(assembly, contact, operation, history[operation], scenario.clearance_mm)
        if play is not None and play > scenario.clearance_mm:
            yield str(contact), play


def _format_span(low_m: float, high_m: float) -> str:
    return f"{low_m * 1e3:g} to {high_m * 1e3:g}"


def _format_axis_point(turn: Turn) -> str:
    """Return the point of a turn, ` through (-30, 0, 0) mm`; empty if it is the origin of the part."""
    return f" through ({', '.join(f'{1e3 * x:g}' for x in turn.point)}) mm" if turn.point.any() else ""


def _name_axis(axis: Array) -> str:
    """Name an axis, (3,), in the frame of the part at its nominal pose: `its x axis`, or `its direction (...)`."""
    i = int(np.argmax(np.abs(axis)))
    if abs(axis[i]) > 1 - 1e-9:  # along a coordinate axis
        return f"its {'-' if axis[i] < 0 else ''}{'xyz'[i]} axis"
    return f"its direction ({', '.join(f'{a:.3g}' for a in axis)})"
