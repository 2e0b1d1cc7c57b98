"""Conditions: what trials have in common that differ in nothing but the seed."""

from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np

from apo_bench.errors import InputError
from apo_bench.records import (
    DEPTH_CAMERA,
    NO_ROBOT_ERROR,
    USUAL,
    TrialConfig,
    knows_truth,
    may_reobserve,
    parse_method,
    probes,
    uses_contacts,
)
from apo_bench.records.run.trials import Trials

_FIRST = ("oracle", "uncorrected", "spiral-search", "nominal", "contact", "paper", "paper-track")
"""Methods as a reader looks for them: the ceiling, what has no correction, `contact`, the paper's two ways."""


@dataclass(frozen=True)
class Place:
    """All but the seed of a trial.

    A curve over the levels has the level 0, and a setting, of which a table or panel is, no method either.
    """

    scenario: str
    clearance_mm: float
    noise: str
    contact_source: str
    human_error_scale: float
    noise_mm: float
    noise_deg: float
    method: str
    grasp: str = TrialConfig.grasp
    fidelity: str = TrialConfig.fidelity
    max_reobservations: int = TrialConfig.max_reobservations
    robot_error: str = TrialConfig.robot_error
    ft_sensor: str = TrialConfig.ft_sensor
    assumed_robot_error: str = TrialConfig.assumed_robot_error
    min_predicted_success: float = TrialConfig.min_predicted_success
    _replace = replace
    """The place with other values of some fields, as of a named tuple."""

    @property
    def place(self) -> "Place":
        """The place of whatever is at one."""
        return Place(*(getattr(self, name) for name in PLACE_FIELDS))

    @property
    def curve(self) -> "Place":
        """The same at every level."""
        return replace(self.place, noise_mm=0.0, noise_deg=0.0)

    @property
    def setting(self) -> "Place":
        """The same at every level, of every method."""
        return replace(self.curve, method="")

    @property
    def noise_words(self) -> str:
        """`0.5`, or `0.5 mm, 1 deg`; `any` of the oracle, which meets none."""
        return "any" if knows_truth(self.method) else noise_label(self.noise_mm, self.noise_deg, self.noise)

    @property
    def words(self) -> Mapping[str, Any]:
        """What a person reads of every axis: `any` where the method does not meet it."""
        met = {
            "noise": not knows_truth(self.method),
            "human_error_scale": not knows_truth(self.method),
            "contact_source": uses_contacts(self.method),
            "max_reobservations": may_reobserve(self.method),
            "ft_sensor": probes(self.method),
            "assumed_robot_error": probes(self.method),
        }
        return {name: getattr(self, name) if met.get(name, True) else "any" for name in PLACE_FIELDS}

    @property
    def title(self) -> str:
        """`stick_in_tower, careless human`, and whatever is not as usual."""
        return f"{self.scenario}, {self.conditions}"

    @property
    def conditions(self) -> str:
        """All but scenario, method and level, as a person says it; whatever is as usual is left out."""
        human = {0.0: "careful human", 1.0: "careless human"}.get(
            self.human_error_scale, f"carelessness {self.human_error_scale:g}"
        )
        said = {
            human: True,
            f"{self.clearance_mm:g} mm clearance": True,
            "range finder" if self.noise == DEPTH_CAMERA else f"{self.noise} noise": self.noise != USUAL,
            f"relations {self.contact_source}": self.contact_source != "given",
            f"{self.grasp} grasp": self.grasp != TrialConfig.grasp,
            f"robot error {self.robot_error}": self.robot_error != NO_ROBOT_ERROR,
            f"fidelity {self.fidelity}": self.fidelity != "full",
            f"{self.max_reobservations} more look{'s' * (self.max_reobservations > 1)}": self.max_reobservations > 0,
            f"wrench {self.ft_sensor}": self.ft_sensor != TrialConfig.ft_sensor,
            f"stated error {self.assumed_robot_error}": self.assumed_robot_error != TrialConfig.assumed_robot_error,
            f"abstaining below {self.min_predicted_success:g}": self.min_predicted_success > 0,
        }
        return ", ".join(words for words, here in said.items() if here)


PLACE_FIELDS = tuple(field.name for field in fields(Place))
"""Columns of a trial record, too."""


def noise_label(noise_mm: float, noise_deg: float, noise: str = "") -> str:
    """`0.5`, `0.5 mm, 1 deg` where the two differ, or `0.5 mm per ray` of the range finder."""
    if noise == DEPTH_CAMERA:
        return f"{noise_mm:g} mm per ray"
    return f"{noise_mm:g}" if noise_mm == noise_deg else f"{noise_mm:g} mm, {noise_deg:g} deg"


def rank(method: str) -> int:
    """Where a method stands in a table; one with `+spiral` or `+probe` ranks like the method."""
    plain = method if method in _FIRST else parse_method(method).corrector
    return _FIRST.index(plain) if plain in _FIRST else len(_FIRST)


def rank_contact_source(contact_source: str) -> tuple[int, str]:
    """Right relations first."""
    return int(contact_source != "given"), contact_source


def order(k: Place) -> tuple[Any, ...]:
    """How cells are sorted: by what is asked, then by method (`oracle` first), then by level."""
    return (
        *(k.scenario, k.clearance_mm, k.noise, rank_contact_source(k.contact_source), k.human_error_scale),
        *(k.grasp, k.robot_error != TrialConfig.robot_error, k.robot_error, k.fidelity != "full"),
        *(
            k.max_reobservations,
            k.ft_sensor != TrialConfig.ft_sensor,
            k.ft_sensor,
            k.assumed_robot_error != TrialConfig.assumed_robot_error,
        ),
        *(k.assumed_robot_error, k.min_predicted_success, rank(k.method), k.method, k.noise_mm, k.noise_deg),
    )


def place_of(row: Mapping[str, Any]) -> Place | None:
    """The cell of a row; None for a measured demonstration, which has no level."""
    if row["noise_mm"] is None:
        return None
    return Place(**{name: row[name] for name in PLACE_FIELDS if name in row})


def by_place(trials: Trials) -> dict[Place, Trials]:
    """The trials of every cell, in the order of their seeds; those of measured demonstrations belong to none.

    Raises:
        InputError: A trial is there twice; counted twice it would make intervals narrower than they are. Or the trials
            were drawn with several salts: they differ, whatever their seeds.
    """
    trials.find_secret_seed()
    levelled = trials.where(~np.isnan(trials.number("noise_mm")))
    cells = {Place(*key): own for key, own in levelled.parts(PLACE_FIELDS).items()}
    for place, own in cells.items():
        seeds = own.number("seed")
        twice = seeds[1:][np.diff(seeds) == 0]
        if len(twice):
            raise InputError(
                f"the rows hold a trial twice ({place.scenario}, {place.method}, level {place.noise_mm:g}, seed "
                f"{twice[0]:.0f}); every trial counts once, so leave one of the two out."
            )
    return {place: cells[place] for place in sorted(cells, key=order)}


def by_method(trials: Trials) -> dict[tuple[str, str], Trials]:
    """Scenario and method -> trials, sorted as cells are."""
    groups = trials.parts(("scenario", "method"))
    return {key: groups[key] for key in sorted(groups, key=lambda key: (key[0], rank(key[1]), key[1]))}
