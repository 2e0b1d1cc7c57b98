"""Settings that the methods and noise levels of one table or panel share."""

from collections.abc import Iterable, Sequence
from typing import Any, TypeVar

from apo_bench.benchmark.analysis.condition import CONDITION_FIELDS, Condition, format_noise_label, make_sort_key
from apo_bench.io import group_by
from apo_bench.records import DEPTH_CAMERA, affects, knows_truth

_Item = TypeVar("_Item", bound=Any)
"""Anything with a condition."""
_SHARED = tuple(name for name in CONDITION_FIELDS if name not in ("method", "noise_mm", "noise_deg"))


def list_settings(items: Iterable[Any]) -> list[Condition]:
    """The settings of items with a condition, sorted; a condition adds one only if no other setting holds it."""
    chosen = set[Condition]()
    # methods that most settings affect come first, so that others find the setting that they belong to
    groups = group_by(
        (tuple(affects(name, item.condition.method) for name in _SHARED), item.condition) for item in items
    )
    for _, alike in sorted(groups.items(), reverse=True):
        chosen |= {c.setting for c in alike if not any(belongs_to(other, c) for other in chosen)}
    return sorted(chosen, key=make_sort_key)


def group_by_setting(settings: Sequence[Condition], items: Iterable[_Item]) -> dict[Condition, list[_Item]]:
    """The items of every setting, in their order; of several oracles the one with most trials."""
    items = list(items)
    return {s: _one_ceiling([item for item in items if belongs_to(s, item.condition)]) for s in settings}


def belongs_to(setting: Condition, condition: Condition) -> bool:
    """Whether a condition belongs to a setting: all agrees that affects its method."""
    return all(
        getattr(setting, name) == getattr(condition, name) or not affects(name, condition.method) for name in _SHARED
    )


def list_levels(items: Iterable[Any]) -> list[tuple[float, float]]:
    """Noise levels in mm and degrees of all but the oracle, sorted."""
    return sorted({get_level(item) for item in items if not knows_truth(item.condition.method)})


def get_level(item: Any) -> tuple[float, float]:
    """In mm and degrees."""
    return item.condition.noise_mm, item.condition.noise_deg


def format_noise(level: tuple[float, float], noise: str) -> str:
    """`0.5`, or `0.5 mm, 1 deg` where they differ."""
    return f"{level[0]:g}" if noise == DEPTH_CAMERA else format_noise_label(*level, noise)


def get_level_unit(noise: str) -> str:
    """The unit of a noise level, for an axis."""
    return "noise level: mm per ray" if noise == DEPTH_CAMERA else "noise level: mm and degrees per axis"


def _one_ceiling(inside: list[_Item]) -> list[_Item]:
    ceilings = [item for item in inside if item.condition.method == "oracle"]
    best = max(ceilings, key=lambda item: getattr(item, "trials", 0), default=None)
    return [item for item in inside if item is best or item.condition.method != "oracle"]
