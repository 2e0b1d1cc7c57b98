"""Settings that the methods and noise levels of one table or panel have in common."""

from collections.abc import Iterable, Sequence
from typing import Any, TypeVar

from apo_bench.benchmark.analysis.condition import CONDITION_FIELDS, Condition, format_noise_label, make_sort_key
from apo_bench.io import group_by
from apo_bench.records import DEPTH_CAMERA, affects, knows_truth

_Item = TypeVar("_Item", bound=Any)
"""An object with an attribute `condition`."""
# settings that identify a panel
_SHARED = tuple(name for name in CONDITION_FIELDS if name not in ("method", "noise_mm", "noise_deg"))


def list_settings(items: Iterable[Any]) -> list[Condition]:
    """Return the settings of items with a condition, sorted.

    A condition adds a setting only if it belongs to none of the others.
    """
    chosen = set[Condition]()
    # methods that depend on most settings come first, so that the others find a setting that they belong to
    groups = group_by(
        (tuple(affects(name, item.condition.method) for name in _SHARED), item.condition) for item in items
    )
    for _, alike in sorted(groups.items(), reverse=True):  # True sorts last, so reversed it comes first
        chosen |= {c.setting for c in alike if not any(belongs_to(other, c) for other in chosen)}
    return sorted(chosen, key=make_sort_key)


def group_by_setting(settings: Sequence[Condition], items: Iterable[_Item]) -> dict[Condition, list[_Item]]:
    """Return the items of every setting, in their order; of several oracles, only the one with most trials."""
    items = list(items)
    return {s: _keep_largest_oracle([item for item in items if belongs_to(s, item.condition)]) for s in settings}


def belongs_to(setting: Condition, condition: Condition) -> bool:
    """Return whether a condition belongs to a setting: all settings that affect its method are equal."""
    return all(
        getattr(setting, name) == getattr(condition, name) or not affects(name, condition.method) for name in _SHARED
    )


def list_levels(items: Iterable[Any]) -> list[tuple[float, float]]:
    """Return the noise levels of all items except the oracle, sorted; in mm and degrees."""
    return sorted({get_level(item) for item in items if not knows_truth(item.condition.method)})


def get_level(item: Any) -> tuple[float, float]:
    """Return the noise level in mm and degrees."""
    return item.condition.noise_mm, item.condition.noise_deg


def format_noise(level: tuple[float, float], noise: str) -> str:
    """Format a noise level: `0.5`, or `0.5 mm, 1 deg` if the two differ."""
    return f"{level[0]:g}" if noise == DEPTH_CAMERA else format_noise_label(*level, noise)


def get_level_unit(noise: str) -> str:
    """Return the label of an axis of noise levels, with the unit."""
    return "noise level: mm per ray" if noise == DEPTH_CAMERA else "noise level: mm and degrees per axis"


def _keep_largest_oracle(inside: list[_Item]) -> list[_Item]:
    """Keep only the oracle with most trials, since noise and other settings do not affect the oracle."""
    ceilings = [item for item in inside if item.condition.method == "oracle"]
    best = max(ceilings, key=lambda item: getattr(item, "trials", 0), default=None)
    return [item for item in inside if item is best or item.condition.method != "oracle"]
