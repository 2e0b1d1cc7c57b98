"""Settings: what the methods and levels of one table or panel have in common."""

from collections.abc import Iterable, Sequence
from typing import Any, TypeVar

from apo_bench.benchmark.analysis.place import Place, level_label, rank_relations
from apo_bench.io import grouped
from apo_bench.records import RANGE, USUAL, feels, knows_relations, knows_truth, may_look

_Item = TypeVar("_Item", bound=Any)
"""Whatever has a place."""


def settings(items: Iterable[Any]) -> list[Place]:
    """The settings of whatever has a place, sorted by scenario first; one makes its own only if no other holds it."""
    chosen = set[Place]()
    # who meets most of what a setting says goes first, so that others find the setting that they belong to
    groups = grouped((_meets(item.place.method), item.place) for item in items)
    for _, alike in sorted(groups.items(), reverse=True):
        chosen |= {p.setting for p in alike if not any(holds(other, p) for other in chosen)}
    return sorted(chosen, key=_order)


def members(settings: Sequence[Place], items: Iterable[_Item]) -> dict[Place, list[_Item]]:
    """The cells, or whatever has a place, of every setting, in their order; of several oracles the one most tried."""
    near = grouped((_site(item.place), item) for item in items)
    return {s: _one_ceiling([x for x in near.get(_site(s), ()) if holds(s, x.place)]) for s in settings}


def holds(setting: Place, place: Place) -> bool:
    """Whether a cell belongs to a setting.

    The oracle meets neither noise nor carelessness, plans without a corrector are not told any relations, few
    methods can ask to look again, and few robots feel.
    """
    method = place.method
    return (
        _site(place) == _site(setting)
        and (knows_truth(method) or (place.noise, place.careless) == (setting.noise, setting.careless))
        and (not knows_relations(method) or place.relations == setting.relations)
        and (not may_look(method) or place.looks == setting.looks)
        and (not feels(method) or (place.wrench, place.stated_error) == (setting.wrench, setting.stated_error))
    )


def levels_of(items: Iterable[Any]) -> list[tuple[float, float]]:
    """Levels in mm and degrees of all but the oracle, sorted."""
    return sorted({level_of(item) for item in items if not knows_truth(item.place.method)})


def level_of(item: Any) -> tuple[float, float]:
    """In mm and degrees."""
    return item.place.level, item.place.level_deg


def level_words(level: tuple[float, float], noise: str) -> str:
    """`0.5`, or `0.5 mm, 1 deg` where they differ."""
    return f"{level[0]:g}" if noise == RANGE else level_label(*level, noise)


def level_unit(noise: str) -> str:
    """What a level is, as an axis says it."""
    return "level: mm per ray" if noise == RANGE else "level: mm and degrees per axis"


def _meets(method: str) -> tuple[bool, ...]:
    """What of a setting a method meets: noise, relations, what a robot that feels is given, looks."""
    return not knows_truth(method), knows_relations(method), feels(method), may_look(method)


def _site(x: Place) -> tuple[Any, ...]:
    return x.scenario, x.clearance_mm, x.grasp, x.fidelity, x.robot_error, x.abstain


def _order(s: Place) -> tuple[Any, ...]:
    conditions = (s.careless, s.grasp, s.fidelity, s.looks, s.robot_error, s.wrench, s.stated_error, s.abstain)
    return (s.scenario, s.clearance_mm, s.noise != USUAL, s.noise, rank_relations(s.relations), *conditions)


def _one_ceiling(inside: list[_Item]) -> list[_Item]:
    ceilings = [item for item in inside if item.place.method == "oracle"]
    best = max(ceilings, key=lambda item: getattr(item, "trials", 0), default=None)
    return [item for item in inside if item is best or item.place.method != "oracle"]
