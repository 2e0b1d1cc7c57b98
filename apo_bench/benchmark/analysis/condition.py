"""Conditions: groups of trials that differ only in their seed."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, make_dataclass, replace
from typing import Any

import numpy as np

from apo_bench.errors import InputError
from apo_bench.records import (
    DEPTH_CAMERA,
    SETTINGS,
    USUAL,
    affects,
    knows_truth,
    parse_method,
)
from apo_bench.records.run.trials import Trials

_FIRST = ("oracle", "uncorrected", "spiral-search", "nominal", "contact", "paper", "paper-track")
"""Methods in the order of tables: oracle, plans without a correction, `contact`, the paper's two methods."""


# settings with a field of their own
_OWN = ("scenario", "clearance_mm", "noise", "contact_source", "human_error_scale", "noise_mm", "noise_deg", "method")
# further settings that distinguish trials; `fidelity` distinguishes conditions though it is no part of a trial's key
_OTHERS = tuple(
    name for name, info in SETTINGS.items() if name not in (*_OWN, "seed") and (info.key or name == "fidelity")
)


def _list_other_fields() -> Iterator[tuple[str, Any, Any]]:
    """Yield each further setting as a field for `make_dataclass`."""
    for name in _OTHERS:
        yield name, Any, field(default=SETTINGS[name].default, kw_only=True)


_Others: Any = make_dataclass("_Others", _list_other_fields(), frozen=True)
"""One field for each further setting that distinguishes trials."""


@dataclass(frozen=True)
class Condition(_Others):  # type: ignore[misc]  # made from the settings, so that a new one is in tables as well
    """All settings of a trial that a sweep may vary, except the seed.

    A condition with noise 0 also stands for a curve over noise levels. With an empty method as well, it stands for a
    setting that a table or panel shows.
    """

    scenario: str
    clearance_mm: float
    noise: str
    contact_source: str
    human_error_scale: float
    noise_mm: float
    noise_deg: float
    method: str

    @property
    def condition(self) -> "Condition":
        """The condition alone, without the results of a subclass."""
        return Condition(**{name: getattr(self, name) for name in CONDITION_FIELDS})

    @property
    def curve(self) -> "Condition":
        """The condition that stands for all noise levels."""
        return replace(self.condition, noise_mm=0.0, noise_deg=0.0)

    @property
    def setting(self) -> "Condition":
        """The condition that stands for all noise levels and methods."""
        return replace(self.curve, method="")

    def with_default(self, name: str) -> "Condition":
        """Return the condition with the default of one setting."""
        changes: dict[str, Any] = {name: SETTINGS[name].default}
        return replace(self.condition, **changes)

    @property
    def noise_words(self) -> str:
        """`0.5`, or `0.5 mm, 1 deg`; `any` of the oracle, which noise does not affect."""
        return "any" if knows_truth(self.method) else format_noise_label(self.noise_mm, self.noise_deg, self.noise)

    @property
    def words(self) -> Mapping[str, Any]:
        """The value of each setting, `any` where it does not affect the method."""
        return {name: getattr(self, name) if affects(name, self.method) else "any" for name in CONDITION_FIELDS}

    @property
    def title(self) -> str:
        """`stick_in_tower, human error 1, 0.25 mm clearance`, and whatever is not a default."""
        return f"{self.scenario}, {self.description}"

    @property
    def description(self) -> str:
        """All settings except scenario, method and noise level in words, without most defaults."""
        words = {
            f"human error {self.human_error_scale:g}": True,
            f"{self.clearance_mm:g} mm clearance": True,
            "depth camera" if self.noise == DEPTH_CAMERA else f"{self.noise} noise": self.noise != USUAL,
            f"contacts {self.contact_source}": self.contact_source != "given",
        }
        for name in _OTHERS:
            value = getattr(self, name)
            words[f"{SETTINGS[name].words} {value}"] = value != SETTINGS[name].default
        return ", ".join(text for text, is_shown in words.items() if is_shown)


CONDITION_FIELDS = (*_OWN, *_OTHERS)
"""Settings that identify a condition, which are also columns of a trial record."""


def format_noise_label(noise_mm: float, noise_deg: float, noise: str = "") -> str:
    """`0.5`, `0.5 mm, 1 deg` where the two differ, or `0.5 mm per ray` of the depth camera."""
    if noise == DEPTH_CAMERA:
        return f"{noise_mm:g} mm per ray"
    return f"{noise_mm:g}" if noise_mm == noise_deg else f"{noise_mm:g} mm, {noise_deg:g} deg"


def rank_method(method: str) -> int:
    """Return the position of a method in tables; the suffixes `+spiral` and `+probe` do not matter."""
    plain = method if method in _FIRST else parse_method(method).corrector
    return _FIRST.index(plain) if plain in _FIRST else len(_FIRST)


def rank_contact_source(contact_source: str) -> tuple[int, str]:
    """Return a sort key that puts the given contacts first."""
    return int(contact_source != "given"), contact_source


def make_sort_key(c: Condition) -> tuple[Any, ...]:
    """Return the sort key of a condition: setting, with defaults first; then method; then noise level."""
    return (*make_settings_key(c), rank_method(c.method), c.method, c.noise_mm, c.noise_deg)


def make_settings_key(c: Condition) -> tuple[Any, ...]:
    """Return the sort key of what a condition sets apart from method and noise level."""
    others = ((getattr(c, name) != SETTINGS[name].default, getattr(c, name)) for name in _OTHERS)
    noise = (c.noise != USUAL, c.noise, rank_contact_source(c.contact_source))
    return (c.scenario, c.clearance_mm, noise, c.human_error_scale, *others)


def get_condition(record: Mapping[str, Any]) -> Condition | None:
    """Return the condition of a record, or None for an observation from a file, which has no noise level."""
    if record["noise_mm"] is None:
        return None
    return Condition(**{name: record[name] for name in CONDITION_FIELDS if name in record})


def group_by_condition(trials: Trials) -> dict[Condition, Trials]:
    """Group trials by condition, each group sorted by seed, without observations from files.

    Raises:
        InputError: A trial occurs twice, which would make intervals too narrow; or the trials were drawn with several
            secret seeds, so that equal seeds are different trials.
    """
    trials.find_secret_seed()
    drawn = trials.where(~np.isnan(trials.number("noise_mm")))  # without observations from files
    parts = drawn.parts(CONDITION_FIELDS).items()
    found = {Condition(**dict(zip(CONDITION_FIELDS, key, strict=True))): own for key, own in parts}
    for condition, own in found.items():
        seeds = own.number("seed")
        twice = seeds[1:][np.diff(seeds) == 0]  # equal neighbours, since seeds are sorted
        if len(twice):
            raise InputError(
                f"the records hold a trial twice ({condition.scenario}, {condition.method}, noise "
                f"{condition.noise_mm:g}, seed {twice[0]:.0f}); every trial counts once, so leave one of the two out."
            )
    return {condition: found[condition] for condition in sorted(found, key=make_sort_key)}


def group_by_method(trials: Trials) -> dict[tuple[str, str], Trials]:
    """Group trials by scenario and method, sorted as conditions are."""
    groups = trials.parts(("scenario", "method"))
    return {key: groups[key] for key in sorted(groups, key=lambda key: (key[0], rank_method(key[1]), key[1]))}
