"""Settings: what the methods and levels of one table or panel have in common."""

from collections.abc import Iterable, Sequence
from typing import Any, TypeVar

from apo_bench.benchmark.analysis.place import Place, noise_label, rank_contact_source
from apo_bench.io import grouped
from apo_bench.records import DEPTH_CAMERA, USUAL, knows_truth, may_reobserve, probes, uses_contacts

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
        and (
            knows_truth(method) or (place.noise, place.human_error_scale) == (setting.noise, setting.human_error_scale)
        )
        and (not uses_contacts(method) or place.contact_source == setting.contact_source)
        and (not may_reobserve(method) or place.max_reobservations == setting.max_reobservations)
        and (
            not probes(method)
            or (place.ft_sensor, place.assumed_robot_error) == (setting.ft_sensor, setting.assumed_robot_error)
        )
    )


def levels_of(items: Iterable[Any]) -> list[tuple[float, float]]:
    """Levels in mm and degrees of all but the oracle, sorted."""
    return sorted({level_of(item) for item in items if not knows_truth(item.place.method)})


def level_of(item: Any) -> tuple[float, float]:
    """In mm and degrees."""
    return item.place.noise_mm, item.place.noise_deg


def noise_words(level: tuple[float, float], noise: str) -> str:
    """`0.5`, or `0.5 mm, 1 deg` where they differ."""
    return f"{level[0]:g}" if noise == DEPTH_CAMERA else noise_label(*level, noise)


def level_unit(noise: str) -> str:
    """What a level is, as an axis says it."""
    return "level: mm per ray" if noise == DEPTH_CAMERA else "level: mm and degrees per axis"


def _meets(method: str) -> tuple[bool, ...]:
    """What of a setting a method meets: noise, relations, what a robot that feels is given, looks."""
    return not knows_truth(method), uses_contacts(method), probes(method), may_reobserve(method)


def _site(x: Place) -> tuple[Any, ...]:
    return x.scenario, x.clearance_mm, x.grasp, x.fidelity, x.robot_error, x.min_predicted_success


def _order(s: Place) -> tuple[Any, ...]:
    conditions = (
        s.human_error_scale,
        s.grasp,
        s.fidelity,
        s.max_reobservations,
        s.robot_error,
        s.ft_sensor,
        s.assumed_robot_error,
        s.min_predicted_success,
    )
    return (s.scenario, s.clearance_mm, s.noise != USUAL, s.noise, rank_contact_source(s.contact_source), *conditions)


def _one_ceiling(inside: list[_Item]) -> list[_Item]:
    ceilings = [item for item in inside if item.place.method == "oracle"]
    best = max(ceilings, key=lambda item: getattr(item, "trials", 0), default=None)
    return [item for item in inside if item is best or item.place.method != "oracle"]
