"""Read observed poses from a JSON or CSV file."""

from math import radians
from pathlib import Path
from typing import NamedTuple

import numpy as np

from apo_bench.arguments import check_arguments
from apo_bench.assembly import Observation
from apo_bench.errors import require
from apo_bench.formats.csv_form import read_table
from apo_bench.formats.deviations import DEVIATION_DEG, DEVIATION_MM, check_deviations
from apo_bench.formats.observation_json import read_json_observation
from apo_bench.scenario import Scenario, place_layout


class ObservationFile(NamedTuple):
    """An observation and its scenario."""

    observation: Observation
    scenario: Scenario
    assumed: bool
    """Whether some standard deviation was missing and the default was assumed."""


@check_arguments
def read_observation(
    path: str | Path,
    scenario: Scenario | str | Path,
    *,
    deviation_mm: float = DEVIATION_MM,
    deviation_deg: float = DEVIATION_DEG,
) -> Observation:
    """Read an observation from a `.csv` file, or from the JSON form of any other.

    Args:
        path: A file with one pose per operation; `docs/guide/measured.md` describes its columns and keys.
        scenario: The scenario of the poses, its name, or its file.
        deviation_mm: Standard deviation along each axis where the file states none.
        deviation_deg: Standard deviation about each axis where the file states none.

    Returns:
        The observation, for `correct`.

    Raises:
        InputError: A fault of the file, with its line or key.
    """
    return read_observation_file(path, scenario, deviation_mm=deviation_mm, deviation_deg=deviation_deg).observation


def read_observation_file(
    path: str | Path,
    scenario: Scenario | str | Path,
    *,
    deviation_mm: float | None = None,
    deviation_deg: float | None = None,
) -> ObservationFile:
    """Read an observation from a file, and return it with its scenario.

    Args:
        deviation_mm, deviation_deg: As in `read_observation`; None means the default.
    """
    from apo_bench.scenario.scenario_file import load_scenario

    assumed = (
        DEVIATION_MM if deviation_mm is None else deviation_mm,
        DEVIATION_DEG if deviation_deg is None else deviation_deg,
    )
    check_deviations(*assumed)
    known = load_scenario(scenario)
    read = read_table if Path(path).suffix.lower() == ".csv" else read_json_observation
    observation, is_assumed = read(path, known, assumed)
    return ObservationFile(observation, known, is_assumed)


def read_fully_stated_observation(path: str | Path, scenario: Scenario) -> Observation:
    """Read an observation from a file that must state all standard deviations.

    Raises:
        InputError: The file deviates from its format, or a standard deviation is missing.
    """
    observation, _, assumed = read_observation_file(path, scenario)
    require(
        not assumed,
        f"{path}: standard deviations are missing; state deviation_mm and deviation_deg of every operation.",
    )
    return observation


def make_nominal_observation(scenario: Scenario, deviation_mm: float, deviation_deg: float) -> Observation:
    """Return the nominal poses of a scenario as an observation with these standard deviations per axis.

    Args:
        deviation_mm, deviation_deg: Along and about each axis.
    """
    check_deviations(deviation_mm, deviation_deg)
    layout = place_layout(scenario, 0.0, 0.0, 0.0)
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
