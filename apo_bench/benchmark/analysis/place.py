"""Conditions: what trials have in common that differ in nothing but the seed."""

from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np

from apo_bench.errors import InputError
from apo_bench.records import (
    NO_ROBOT_ERROR,
    RANGE,
    USUAL,
    TrialSettings,
    feels,
    knows_relations,
    knows_truth,
    may_look,
    parsed,
)
from apo_bench.records.run.trials import Trials

_FIRST = ("oracle", "none", "search", "by-heart", "contact", "paper", "paper-track")
"""Methods as a reader looks for them: the ceiling, what has no correction, `contact`, the paper's two ways."""


@dataclass(frozen=True)
class Place:
    """All but the seed of a trial.

    A curve over the levels has the level 0, and a setting, of which a table or panel is, no method either.
    """

    scenario: str
    clearance_mm: float
    noise: str
    relations: str
    careless: float
    level: float
    level_deg: float
    method: str
    grasp: str = TrialSettings.grasp
    fidelity: str = TrialSettings.fidelity
    looks: int = TrialSettings.looks
    robot_error: str = TrialSettings.robot_error
    wrench: str = TrialSettings.wrench
    stated_error: str = TrialSettings.stated_error
    abstain: float = TrialSettings.abstain
    _replace = replace
    """The place with other values of some fields, as of a named tuple."""

    @property
    def place(self) -> "Place":
        """The place of whatever is at one."""
        return Place(*(getattr(self, name) for name in PLACE_FIELDS))

    @property
    def curve(self) -> "Place":
        """The same at every level."""
        return replace(self.place, level=0.0, level_deg=0.0)

    @property
    def setting(self) -> "Place":
        """The same at every level, of every method."""
        return replace(self.curve, method="")

    @property
    def level_words(self) -> str:
        """`0.5`, or `0.5 mm, 1 deg`; `any` of the oracle, which meets none."""
        return "any" if knows_truth(self.method) else level_label(self.level, self.level_deg, self.noise)

    @property
    def words(self) -> Mapping[str, Any]:
        """What a person reads of every axis: `any` where the method does not meet it."""
        met = {
            "noise": not knows_truth(self.method),
            "careless": not knows_truth(self.method),
            "relations": knows_relations(self.method),
            "looks": may_look(self.method),
            "wrench": feels(self.method),
            "stated_error": feels(self.method),
        }
        return {name: getattr(self, name) if met.get(name, True) else "any" for name in PLACE_FIELDS}

    @property
    def title(self) -> str:
        """`stick_in_tower, careless human`, and whatever is not as usual."""
        return f"{self.scenario}, {self.conditions}"

    @property
    def conditions(self) -> str:
        """All but scenario, method and level, as a person says it; whatever is as usual is left out."""
        human = {0.0: "careful human", 1.0: "careless human"}.get(self.careless, f"carelessness {self.careless:g}")
        said = {
            human: True,
            f"{self.clearance_mm:g} mm clearance": True,
            "range finder" if self.noise == RANGE else f"{self.noise} noise": self.noise != USUAL,
            f"relations {self.relations}": self.relations != "given",
            f"{self.grasp} grasp": self.grasp != TrialSettings.grasp,
            f"robot error {self.robot_error}": self.robot_error != NO_ROBOT_ERROR,
            f"fidelity {self.fidelity}": self.fidelity != "full",
            f"{self.looks} more look{'s' * (self.looks > 1)}": self.looks > 0,
            f"wrench {self.wrench}": self.wrench != TrialSettings.wrench,
            f"stated error {self.stated_error}": self.stated_error != TrialSettings.stated_error,
            f"abstaining below {self.abstain:g}": self.abstain > 0,
        }
        return ", ".join(words for words, here in said.items() if here)


PLACE_FIELDS = tuple(field.name for field in fields(Place))
"""Columns of a trial record, too."""


def level_label(level: float, level_deg: float, noise: str = "") -> str:
    """`0.5`, `0.5 mm, 1 deg` where the two differ, or `0.5 mm per ray` of the range finder."""
    if noise == RANGE:
        return f"{level:g} mm per ray"
    return f"{level:g}" if level == level_deg else f"{level:g} mm, {level_deg:g} deg"


def rank(method: str) -> int:
    """Where a method stands in a table; one with `+search` or `+feel` ranks like the method."""
    plain = method if method in _FIRST else parsed(method).plan
    return _FIRST.index(plain) if plain in _FIRST else len(_FIRST)


def rank_relations(relations: str) -> tuple[int, str]:
    """Right relations first."""
    return int(relations != "given"), relations


def order(k: Place) -> tuple[Any, ...]:
    """How cells are sorted: by what is asked, then by method (`oracle` first), then by level."""
    return (
        *(k.scenario, k.clearance_mm, k.noise, rank_relations(k.relations), k.careless),
        *(k.grasp, k.robot_error != TrialSettings.robot_error, k.robot_error, k.fidelity != "full"),
        *(k.looks, k.wrench != TrialSettings.wrench, k.wrench, k.stated_error != TrialSettings.stated_error),
        *(k.stated_error, k.abstain, rank(k.method), k.method, k.level, k.level_deg),
    )


def place_of(row: Mapping[str, Any]) -> Place | None:
    """The cell of a row; None for a measured demonstration, which has no level."""
    if row["level"] is None:
        return None
    return Place(**{name: row[name] for name in PLACE_FIELDS if name in row})


def by_place(trials: Trials) -> dict[Place, Trials]:
    """The trials of every cell, in the order of their seeds; those of measured demonstrations belong to none.

    Raises:
        InputError: A trial is there twice; counted twice it would make intervals narrower than they are. Or the trials
            were drawn with several salts: they differ, whatever their seeds.
    """
    trials.find_salt()
    levelled = trials.where(~np.isnan(trials.number("level")))
    cells = {Place(*key): own for key, own in levelled.parts(PLACE_FIELDS).items()}
    for place, own in cells.items():
        seeds = own.number("seed")
        twice = seeds[1:][np.diff(seeds) == 0]
        if len(twice):
            raise InputError(
                f"the rows hold a trial twice ({place.scenario}, {place.method}, level {place.level:g}, seed "
                f"{twice[0]:.0f}); every trial counts once, so leave one of the two out."
            )
    return {place: cells[place] for place in sorted(cells, key=order)}


def by_method(trials: Trials) -> dict[tuple[str, str], Trials]:
    """Scenario and method -> trials, sorted as cells are."""
    groups = trials.parts(("scenario", "method"))
    return {key: groups[key] for key in sorted(groups, key=lambda key: (key[0], rank(key[1]), key[1]))}
