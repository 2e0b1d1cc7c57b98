"""The task card of a scenario, in Markdown: everything in it is read off the scenario, nothing is said twice."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import groupby
from types import MappingProxyType

import numpy as np

from apo_bench.assembly import Arc, Graph, Layout, joint_play_mm, placements, relation_graph, touched_contacts
from apo_bench.geometry import Array
from apo_bench.io import listed_words
from apo_bench.judging.finished import fixtures
from apo_bench.planning.insertion.states import classify
from apo_bench.scenario import NOTHING_M, HumanError, Scenario, Turn, spread_error

_NOTHING: Mapping[str, str] = MappingProxyType({})
_LEVEL = 0.01
"""A face is upright if its normal rises or falls by less."""


def cards(
    scenarios: Sequence[Scenario],
    command: str,
    picture: str,
    introduction: str = "",
    measured: Mapping[str, str] = _NOTHING,
) -> str:
    """A page with the cards of all, written by `command`; `picture` is the path of a graph with `{}` for the name.

    Args:
        introduction: What stands above the cards of what was measured.
        measured: Scenario -> what was measured of it, in Markdown.
    """
    lines = [
        *(f"<!-- Written by `{command}`; change the scenarios, not this page. -->", "", "# Scenarios", ""),
        *(f"- [{s.name}](#{s.name}): {s.title} ({s.paper})" for s in scenarios),
        *("", "What is asked for under *Success*: [the two verdicts](../how/judge.md)."),
        *(["", introduction] if introduction else []),
    ]
    for s in scenarios:
        head, _, rest = scenario_card(s, 2).partition("\n\n")
        graph = f"![Relations of {s.name} after its last operation]({picture.format(s.name)})"
        lines += ["", f'<a id="{s.name}"></a>', "", head, "", graph, "", rest.rstrip("\n")]
        lines += ["", "### What it asks for", "", measured[s.name]] if s.name in measured else []
    return "\n".join(lines) + "\n"


def scenario_card(scenario: Scenario, level: int = 1) -> str:
    """The card of a scenario under a heading of that level."""
    mark = "#" * level
    graph = relation_graph(scenario.assembly)
    parts = [
        f"{name}{'' if path.stem == name else f' ({path.stem})'}{', fixed' if name in scenario.assembly.fixed else ''}"
        for name, path in scenario.part_files.items()
    ]
    sections = (
        f"{mark} {scenario.name}: {scenario.title}",
        f"In the paper: {scenario.paper}." if scenario.paper else "",
        f"{mark}# Parts\n\n" + _list(parts),
        f"{mark}# Operations\n\n" + "\n".join(_operations(scenario, graph)),
        f"{mark}# The human\n\n" + _list([*filter(None, [scenario.human]), _carelessness(scenario)]),
        f"{mark}# What varies\n\n" + _list(_varies(scenario)),
        f"{mark}# Success\n\n" + _list(_success(scenario)),
    )
    return "\n\n".join(filter(None, sections)) + "\n"


def _list(lines: Iterable[str]) -> str:
    return "\n".join(f"- {line}" for line in lines)


def _operations(scenario: Scenario, graph: Graph) -> Iterator[str]:
    """`5. stick into cube2 and cube3: R6 stick -> cube2 (py-hpy, ...), R7 ...; loses R2`."""
    for k, operation in enumerate(scenario.assembly.operations):
        new = [arc for arc in graph.arcs if arc.made == k]
        lost = [arc.name for arc in graph.arcs if arc.lost == k]
        carrying = f", carrying {listed_words(operation.carries)}," if operation.carries else ""
        where = _where(scenario, new)
        relations = ", ".join(f"{arc} ({', '.join(arc.pairs)})" for arc in new) or "no contact"
        loses = f"; loses {', '.join(lost)}" if lost else ""
        yield f"{k + 1}. {operation.main}{carrying}{f' {where}' if where else ''}: {relations}{loses}"


def _where(scenario: Scenario, arcs: Sequence[Arc]) -> str:
    """`onto table and against cube`."""
    ways = groupby(dict.fromkeys((_way(scenario, arc), arc.environment.part) for arc in arcs), key=lambda end: end[0])
    return listed_words([f"{way} {listed_words([part for _, part in same])}" for way, same in ways])


def _way(scenario: Scenario, arc: Arc) -> str:
    """`into` between walls, `over` what stands in its hole, `under` faces that look down, `against` upright faces,
    `onto` others."""
    assembly = scenario.assembly
    poses = placements(assembly, scenario.start, scenario.goals)[arc.made]
    touched = touched_contacts(assembly, arc.contacts, assembly.operations[arc.made].moves, poses)
    # normals of all faces that are touched: their span says in which contact state the part is
    N = np.array([each.normal for each in touched])
    if classify(N).state.constraining:
        rounds = [
            assembly.round_face(contact.manipulated)
            for contact in arc.contacts
            if all(of.face in assembly.solids[of.part].rounds for of in contact)
        ]
        return "over" if rounds and all(face.hole for face in rounds) else "into"
    if N[:, 2].min() < -_LEVEL:
        return "under"
    return "against" if N[:, 2].max() < _LEVEL else "onto"


def _carelessness(scenario: Scenario) -> str:
    how = scenario.human_error
    if how is None:
        return "No carelessness is drawn."
    main = scenario.assembly.operations[how.operation].main
    return (
        f"At `human_error_scale` 1, operation {how.operation + 1} puts {main} {_span(how.low_m, how.high_m)} mm aside along "
        f"{_axis(how.axis)}, to either side{_followers(scenario, how)}; "
        "what is wrong is mended at the last operation, unseen."
    )


def _followers(scenario: Scenario, how: HumanError) -> str:
    """The operations that an error leads astray, being guided by a displaced face."""
    offsets = spread_error(scenario, Layout(scenario.goals, scenario.start), how.axis).offsets
    led = [k for k in np.flatnonzero(np.linalg.norm(offsets, axis=1) > NOTHING_M) if k != how.operation]
    words = [f"{scenario.assembly.operations[k].main} (operation {k + 1})" for k in led]
    return f"; {listed_words(words)} {'follow' if len(words) > 1 else 'follows'}" if words else ""


def _varies(scenario: Scenario) -> list[str]:
    site = scenario.site
    x, y = (f"{c * 1e3:g} ± {s * 1e3:g}" for c, s in zip(site.center_m, site.spread_m, strict=True))
    low, high = np.degrees(site.yaw_rad)
    names = [f"Operation {k}: {operation.main}" for k, operation in enumerate(scenario.assembly.operations, start=1)]
    return [
        f"Where the assembly stands: x {x} mm, y {y} mm, turned by {low:g} to {high:g} degrees.",
        *(f"{names[s.operation]} by {_span(s.low_m, s.high_m)} mm along {_axis(s.axis)}." for s in scenario.shifts),
        *(
            f"{names[turn.operation]} by {np.degrees(turn.low_rad):g} to {np.degrees(turn.high_rad):g} degrees about "
            f"{_axis(turn.axis)}{_through(turn)}."
            for turn in scenario.turns
        ),
    ]


def _success(scenario: Scenario) -> Iterator[str]:
    t = scenario.thresholds
    clearance = scenario.clearance_mm
    wider = "; ".join(f"{contact} by {play + t.fit_margin_mm:.2f} mm" for contact, play in sorted(_wider(scenario)))
    away = sorted(fixtures(scenario.assembly))
    is_round = any(map(scenario.assembly.is_round, (relation.contact for relation in scenario.assembly.relations())))
    said: dict[str, object] = {
        scenario.success: scenario.success,
        f"Success, at the end: contacts of parts that fit within {clearance + t.fit_margin_mm:g} mm (at {clearance:g} "
        f"mm clearance per side), other contacts within {t.support_mm:g} mm, over at least "
        f"{100 * t.overlap_fraction:g} % of the true overlap; no part more than {t.penetration_mm:g} mm inside "
        f"another, no parts that touch slid against each other by more than {t.displaced_mm:g} mm since they were put; "
        f"all let go of and slower than {t.rest_mm_s:g} mm/s and {t.rest_deg_s:g} degrees/s.": True,
        "The play of all faces of two parts together leaves some of them more, so they may be farther apart: "
        f"{wider}.": wider,
        "Of round faces the axes count, at both ends of the length that they have in common, which is their overlap; a "
        "hole that is wider than its shaft allows that much more. A part of revolution may end at any turn about its "
        "axis.": is_round,
        f"Where {listed_words(away)} ends is free: it is a fixture, used and put away.": away,
        "As demonstrated: the same, and every contact also when it was made, where it was shown; no part in place "
        f"pushed on the way, nor a corner of one more than {t.displaced_mm:g} mm from where it was put."
        + " Here only that is a success."
        * (scenario.success_means != "assembled"): True,
        f"Loose: every contact within {t.loose_gap_mm:g} mm and {t.loose_angle_deg:g} degrees, over the same "
        "overlap.": True,
        f"Contact equations count as solved below {scenario.gap_mm:g} mm.": True,
    }
    return (sentence for sentence, holds in said.items() if holds)


def _wider(scenario: Scenario) -> Iterator[tuple[str, float]]:
    """Contacts whose faces can come farther apart than their own clearance, and how far, [mm]; at the nominal goals."""
    assembly = scenario.assembly
    history = placements(assembly, scenario.start, scenario.goals)
    for contact, operation, _ in assembly.relations():
        play = joint_play_mm(assembly, contact, operation, history[operation], scenario.clearance_mm)
        if play is not None and play > scenario.clearance_mm:
            yield str(contact), play


def _span(low_m: float, high_m: float) -> str:
    return f"{low_m * 1e3:g} to {high_m * 1e3:g}"


def _through(turn: Turn) -> str:
    """` through (-30, 0, 0) mm`, unless that is the origin of the part."""
    return f" through ({', '.join(f'{1e3 * x:g}' for x in turn.point)}) mm" if turn.point.any() else ""


def _axis(axis: Array) -> str:
    """`its x axis`, of the part at its goal."""
    i = int(np.argmax(np.abs(axis)))
    if abs(axis[i]) > 1 - 1e-9:
        return f"its {'-' if axis[i] < 0 else ''}{'xyz'[i]} axis"
    return f"its direction ({', '.join(f'{a:.3g}' for a in axis)})"
