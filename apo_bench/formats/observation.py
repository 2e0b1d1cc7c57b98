"""Read observed poses from a file: the JSON form of `apo_bench.formats.json_forms`, or comma-separated values."""

from math import radians
from pathlib import Path
from typing import NamedTuple

import numpy as np

from apo_bench.arguments import check_arguments
from apo_bench.assembly import Observation
from apo_bench.errors import require
from apo_bench.formats import json_reading
from apo_bench.formats.csv_form import read_table
from apo_bench.formats.deviations import DEVIATION_DEG, DEVIATION_MM, check_deviations
from apo_bench.scenario import Scenario, layout_at


class ObservationFile(NamedTuple):
    """An observation with its scenario."""

    observation: Observation
    scenario: Scenario
    assumed: bool
    """Whether a standard deviation had to be assumed."""


@check_arguments
def read_observation(
    path: str | Path,
    scenario: Scenario | str | Path,
    *,
    deviation_mm: float = DEVIATION_MM,
    deviation_deg: float = DEVIATION_DEG,
) -> Observation:
    """An observation from a `.csv` file, or from the JSON form of any other.

    Args:
        scenario: The scenario it is of, its name, or its file.
        deviation_mm: Standard deviation along each axis where the file states none.
        deviation_deg: Standard deviation about each axis where the file states none.

    Raises:
        InputError: Anything that is not as described, with the place where it stands.
    """
    return read_observation_file(path, scenario, deviation_mm=deviation_mm, deviation_deg=deviation_deg).observation


def read_observation_file(
    path: str | Path,
    scenario: Scenario | str | Path,
    *,
    deviation_mm: float | None = None,
    deviation_deg: float | None = None,
) -> ObservationFile:
    """An observation from a file, with its scenario, and whether a standard deviation had to be assumed.

    Args:
        deviation_mm, deviation_deg: As in `read_observation`; None stands for the default.
    """
    from apo_bench.scenario.file import load_scenario

    deviation_mm = DEVIATION_MM if deviation_mm is None else deviation_mm
    deviation_deg = DEVIATION_DEG if deviation_deg is None else deviation_deg
    check_deviations(deviation_mm, deviation_deg)
    require(
        isinstance(path, str | Path), f"{path!r} was given as an observation; give the path of a .csv or .json file."
    )
    known = load_scenario(scenario)
    if Path(path).suffix.lower() != ".csv":
        seen, assumed = json_reading.read_json_observed(path, known, (deviation_mm, deviation_deg))
    else:
        seen, assumed = read_table(path, known, deviation_mm=deviation_mm, deviation_deg=deviation_deg)
    return ObservationFile(seen, known, assumed)


def read_stated(path: str | Path, scenario: Scenario) -> Observation:
    """An observation from a file that states every standard deviation itself.

    Raises:
        InputError: Anything that is not as described, or a standard deviation is missing.
    """
    if Path(path).suffix.lower() != ".csv":
        return json_reading.read_json_observation(path, scenario)
    observation, _, assumed = read_observation_file(path, scenario)
    require(
        not assumed,
        f"{path}: standard deviations are missing; add columns deviation_mm and deviation_deg, filled in every row.",
    )
    return observation


def as_planned(scenario: Scenario, deviation_mm: float, deviation_deg: float) -> Observation:
    """The nominal goals of a scenario, as if they had been seen with these standard deviations."""
    check_deviations(deviation_mm, deviation_deg)
    layout = layout_at(scenario, 0.0, 0.0, 0.0)
    n = len(scenario.assembly)
    covariance = np.diag([deviation_mm * 1e-3] * 3 + [radians(deviation_deg)] * 3) ** 2
    return Observation(
        assembly=scenario.assembly,
        start=layout.start,
        poses=layout.poses,
        covariance=np.tile(covariance, (n, 1, 1)),
        observed=np.ones(n, dtype=np.bool_),
        gap_m=scenario.gap_mm * 1e-3,
        play_m=scenario.clearance_mm * 1e-3,
    )
