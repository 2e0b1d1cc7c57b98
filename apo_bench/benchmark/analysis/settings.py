"""Settings: what the methods and noise levels of one table or panel have in common."""

from collections.abc import Iterable, Sequence
from typing import Any, TypeVar

from apo_bench.benchmark.analysis.condition import CONDITION_FIELDS, Condition, noise_label, order
from apo_bench.io import grouped
from apo_bench.records import DEPTH_CAMERA, affects, knows_truth

_Item = TypeVar("_Item", bound=Any)
"""Anything with a condition."""
_SHARED = tuple(name for name in CONDITION_FIELDS if name not in ("method", "noise_mm", "noise_deg"))


def settings(items: Iterable[Any]) -> list[Condition]:
    """The settings of items with a condition, sorted; a condition adds one only if no other setting holds it."""
    chosen = set[Condition]()
    # methods that most settings affect come first, so that others find the setting that they belong to
    groups = grouped(
        (tuple(affects(name, item.condition.method) for name in _SHARED), item.condition) for item in items
    )
    for _, alike in sorted(groups.items(), reverse=True):
        chosen |= {c.setting for c in alike if not any(holds(other, c) for other in chosen)}
    return sorted(chosen, key=order)


def members(settings: Sequence[Condition], items: Iterable[_Item]) -> dict[Condition, list[_Item]]:
    """The items of every setting, in their order; of several oracles the one with most trials."""
    items = list(items)
    return {s: _one_ceiling([item for item in items if holds(s, item.condition)]) for s in settings}


def holds(setting: Condition, condition: Condition) -> bool:
    """Whether a condition belongs to a setting: all agrees that affects its method."""
    return all(
        getattr(setting, name) == getattr(condition, name) or not affects(name, condition.method) for name in _SHARED
    )


def levels_of(items: Iterable[Any]) -> list[tuple[float, float]]:
    """Noise levels in mm and degrees of all but the oracle, sorted."""
    return sorted({level_of(item) for item in items if not knows_truth(item.condition.method)})


def level_of(item: Any) -> tuple[float, float]:
    """In mm and degrees."""
    return item.condition.noise_mm, item.condition.noise_deg


def noise_words(level: tuple[float, float], noise: str) -> str:
    """`0.5`, or `0.5 mm, 1 deg` where they differ."""
    return f"{level[0]:g}" if noise == DEPTH_CAMERA else noise_label(*level, noise)


def level_unit(noise: str) -> str:
    """The unit of a noise level, for an axis."""
    return "noise level: mm per ray" if noise == DEPTH_CAMERA else "noise level: mm and degrees per axis"


def _one_ceiling(inside: list[_Item]) -> list[_Item]:
    ceilings = [item for item in inside if item.condition.method == "oracle"]
    best = max(ceilings, key=lambda item: getattr(item, "trials", 0), default=None)
    return [item for item in inside if item is best or item.condition.method != "oracle"]
