"""What one trial is made of: every setting of a row, checked at the door."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from numbers import Real
from typing import Never, final

import numpy as np

from apo_bench.errors import InputError, unknown
from apo_bench.records.method import checked_method
from apo_bench.records.relations import checked_relations
from apo_bench.records.salt import Salt

ENV_ID = "APOReplay-v0"
ROW = "apo-bench/row/6"
EYES = ("noise", "range")
"""Poses with noise that is drawn, or a simulated range finder that measures them."""
RANGE = "range"
USUAL = "isotropic"
"""The noise model where none is asked for."""
METHOD = "contact"
"""The method where none is asked for."""
LARGEST_LEVEL = 50.0
"""[mm] and [degrees]: five times that is still inside the room."""
FIDELITIES = ("full", "contact")
"""Every motion is simulated, or the part of each in which things may touch."""
LARGEST_CARELESS = 10.0
LARGEST_CLEARANCE_MM = 5.0
LARGEST_SEED = 2**53 - 1
"""Whole numbers up to here survive every JSON reader."""


@final
@dataclass(frozen=True)
class TrialSettings:
    """One trial: with the same code and the same assets it determines its row."""

    scenario: str
    """A name, or the path of a scenario file."""
    level_mm: float = 1.0
    level_deg: float = 1.0
    careless: float = 1.0
    clearance_mm: float = 0.25
    noise: str = USUAL
    grasp: str = "friction"
    arm: str = "six_axis"
    method: str = METHOD
    seed: int = 0
    timestep_s: float = 0.001
    relations: str = "given"
    """What a corrector is told of the contacts: `given`, `recognised`, `recognised-fixed`, `recognised-twice`, or wrong
    ones: `missed`, `false`, `shifted:3` (mm), or `module:name`."""
    eye: str = "noise"
    """`noise`, or `range`: poses are measured in depth images; `level_mm` is the noise of a ray then, `level_deg` is
    zero and `noise` is `range`."""
    fidelity: str = "full"
    """`full`, or `contact`: only the part of each motion in which things may touch is simulated."""
    salt: Salt | None = field(default=None, repr=False)
    """Enters every stream of chance; None for a trial that everybody can draw."""

    def __post_init__(self) -> None:
        check_eye(self.eye)
        check_level(self.level_mm, "level in mm", self.eye)
        check_level(self.level_deg, "level in degrees")
        check_careless(self.careless)
        check_clearance(self.clearance_mm)
        object.__setattr__(self, "method", checked_method(self.method))
        check_seed(self.seed)
        check_fidelity(self.fidelity, self.grasp)
        object.__setattr__(self, "relations", checked_relations(self.relations))
        if self.eye == RANGE:
            if self.noise not in (USUAL, RANGE):
                refuse_noise(self.noise)
            object.__setattr__(self, "noise", RANGE)
            object.__setattr__(self, "level_deg", 0.0)


def check_level(level: float, what: str = "level", eye: str = "noise") -> None:
    """Raise an `InputError` unless the level is a number from 0 to the largest."""
    of = "1 mm per ray" if eye == RANGE else "1 mm and 1 degree"
    _within(level, 0.0, LARGEST_LEVEL, what, f"where 1 means a standard deviation of {of}")


def level_pair(level: float | Sequence[float], eye: str = "noise") -> tuple[float, float]:
    """A level in mm and in degrees: one number stands for both, a pair for each; of a ray it is one, in mm."""
    several = tuple(level) if isinstance(level, Iterable) and not isinstance(level, str) else (level,)
    numbers = all(isinstance(x, Real) and not isinstance(x, bool | np.bool_) for x in several)
    given = tuple(map(float, several)) if numbers else ()
    if eye == RANGE and len(given) != 1:
        raise InputError(f"the level {level!r} was given with the eye 'range'; one number is allowed, mm per ray.")
    if len(given) not in (1, 2):
        raise InputError(f"the level {level!r} was given; one number is allowed, or a pair of mm and degrees.")
    mm, deg = given[0], 0.0 if eye == RANGE else given[-1]
    check_level(mm, "level in mm", eye)
    check_level(deg, "level in degrees")
    return mm, deg


def check_careless(careless: float) -> None:
    """Raise an `InputError` unless it is a number from 0 to the largest."""
    _within(careless, 0.0, LARGEST_CARELESS, "carelessness", "where 0 is a careful human and 1 the scenario's")


def check_clearance(clearance_mm: float) -> None:
    """Raise an `InputError` unless the clearance can be one; what a part can have is the scene's to say."""
    _within(clearance_mm, 0.0, LARGEST_CLEARANCE_MM, "clearance", "in mm per side")


def check_seed(seed: int) -> None:
    """Raise an `InputError` unless the seed is a whole number from 0."""
    if not 0 <= seed <= LARGEST_SEED:
        raise InputError(f"a seed of {seed} was given; whole numbers from 0 to {LARGEST_SEED} are allowed.")


def check_eye(eye: str) -> None:
    """Raise an `InputError` unless there is such an eye."""
    if not isinstance(eye, str) or eye not in EYES:
        raise InputError(unknown("eye", str(eye), EYES))


def check_fidelity(fidelity: str, *grasps: str) -> None:
    """Raise an `InputError` unless there is such a fidelity, and its verdicts are known to be those of `full`."""
    if not isinstance(fidelity, str) or fidelity not in FIDELITIES:
        raise InputError(unknown("fidelity", str(fidelity), FIDELITIES))
    if fidelity == "contact" and "weld" in grasps:
        raise InputError(
            "the fidelity 'contact' was given together with the grasp 'weld', with which its verdicts differ; "
            "use the grasp friction, or full."
        )


def refuse_noise(*noises: object) -> Never:
    """Raise an `InputError`: noise models were asked for where poses are measured, so they would draw nothing."""
    names = ", ".join(f"'{noise}'" for noise in noises if isinstance(noise, str))
    raise InputError(
        f"the noise {names or 'model'} was given together with the eye 'range', which draws no pose noise; the level "
        "is the noise of its rays in mm, so leave one of the two out."
    )


def _within(x: float, low: float, high: float, what: str, meaning: str) -> None:
    number = isinstance(x, Real)
    if not (number and math.isfinite(x) and low <= x <= high):
        given = f"{x:g}" if number else repr(x)
        raise InputError(f"a {what} of {given} was given; a number from {low:g} to {high:g} is allowed, {meaning}.")
