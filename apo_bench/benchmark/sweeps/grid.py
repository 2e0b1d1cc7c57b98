"""The grids of a sweep: which trials there are, and which of them share a demonstration."""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from itertools import product
from numbers import Integral, Real
from typing import Any, final

from apo_bench.arguments import check_arguments
from apo_bench.errors import require, require_text
from apo_bench.io import UNSHOWN, grouped
from apo_bench.records import (
    LEVEL,
    RANGE,
    SETTINGS,
    Salt,
    SettingInfo,
    TrialSettings,
    check,
    check_squares,
    check_together,
    feels,
    knows_relations,
    knows_truth,
    level_pair,
    may_look,
    refuse_noise,
)
from apo_bench.scenario import Scenario, load_scenario

MOST_TRIALS = 1_000_000
"""Of all cells of a sweep together: their specifications are held in memory, half a kilobyte each."""
AXES: tuple[SettingInfo, ...] = tuple(info for info in (*SETTINGS.values(), LEVEL) if info.axis)
"""What a sweep has several of."""
_MAY_BE_EMPTY = ("clearance_mm", "noise")
SHARED: tuple[str, ...] = tuple(info.name for info in SETTINGS.values() if info.shared)
"""What all grids of a sweep have in common, so that no key tells trials apart by it."""
_VARIED = tuple(info for info in AXES if info.name not in ("scenario", "clearance_mm"))
_MET_BY_SOME = {"relations": knows_relations, "looks": may_look, "wrench": feels, "stated_error": feels}
"""What not every method meets: contacts, looks, and what a robot that feels is given."""
Batch = tuple[TrialSettings, ...]
"""Trials of one scenario, clearance, seed, carelessness and eye: they share layout and demonstration."""
_Level = float | tuple[float, float]
"""Mm and degrees, or the two apart."""


@final
@check_arguments
@dataclass(frozen=True)
class SweepSettings:
    """What a sweep varies; it runs every combination, with the same seeds in every cell."""

    scenarios: tuple[str, ...]
    """Names, or paths of scenario files."""
    levels: tuple[_Level, ...] = LEVEL.swept
    careless: tuple[float, ...] = SETTINGS["careless"].swept
    methods: tuple[str, ...] = SETTINGS["method"].swept
    clearances_mm: tuple[float, ...] = ()
    """Empty stands for each scenario's own."""
    trials: int = 100
    seed: int = 0
    """The first of the seeds."""
    noises: tuple[str, ...] = ()
    """Empty stands for `isotropic`, and for none where no eye draws any."""
    relations: tuple[str, ...] = (TrialSettings.relations,)
    eyes: tuple[str, ...] = (TrialSettings.eye,)
    """Noise models are those of the eye `noise`."""
    grasps: tuple[str, ...] = (TrialSettings.grasp,)
    robot_errors: tuple[str, ...] = (TrialSettings.robot_error,)
    """The oracle meets them too."""
    looks: tuple[int, ...] = (TrialSettings.looks,)
    """Methods that cannot ask run once, with none."""
    wrenches: tuple[str, ...] = (TrialSettings.wrench,)
    stated_errors: tuple[str, ...] = (TrialSettings.stated_error,)
    """Methods without `+feel` run once, with the usual of both."""
    abstains: tuple[float, ...] = (TrialSettings.abstain,)
    """The oracle abstains too."""
    arm: str = TrialSettings.arm
    timestep_s: float = TrialSettings.timestep_s
    fidelity: str = TrialSettings.fidelity

    def __post_init__(self) -> None:
        for info in AXES:
            entries = getattr(self, info.axis) if info.is_whole else map(_plain, getattr(self, info.axis))
            values = tuple(dict.fromkeys(map(info.spelled, entries) if info.spelled else entries))
            require(
                values or info.name in _MAY_BE_EMPTY,
                f"no {info.axis} were given for the sweep; at least one is needed.",
            )
            object.__setattr__(self, info.axis, values)
        require(
            isinstance(self.trials, Integral) and 1 <= self.trials <= MOST_TRIALS,
            f"{self.trials} trials were given; a whole number from 1 to {MOST_TRIALS} is allowed.",
        )
        object.__setattr__(self, "trials", int(self.trials))
        check("seed", self.seed)
        check("seed", self.seed + self.trials - 1)
        for eye in self.eyes:
            check("eye", eye)
        drawn = set(self.eyes) != {RANGE}
        if self.noises and not drawn:
            refuse_noise(*self.noises)
        object.__setattr__(self, "noises", self.noises or (TrialSettings.noise,) * drawn)
        for level, eye in product(self.levels, self.eyes):
            if isinstance(level, tuple):
                level_pair(level, eye)
            else:
                check("level_mm", level, eye, "level")
        for name, values in (
            {name: getattr(self, info.axis) for name, info in SETTINGS.items() if info.axis}
            | {name: (getattr(self, name),) for name in SHARED}
        ).items():
            for value in values:
                check(name, value)
                if SETTINGS[name].is_text:
                    require_text(name, value)
                require(
                    not SETTINGS[name].is_text or name == "scenario" or not UNSHOWN.search(value),
                    f"the name {value!r} was given, which has control characters or half letters; use another one.",
                )
        check_together(self.fidelity, *self.grasps)
        check_squares(any(map(feels, self.methods)), *self.grasps)


def check_grids(grids: Sequence[SweepSettings]) -> None:
    """Raise an `InputError` unless there is a grid, all have the same arm, time step and fidelity, and they are not
    larger than can be held."""
    require(grids, "no grid was given for the sweep; at least one is needed.")
    for name in SHARED:
        values = {getattr(grid, name): None for grid in grids}
        require(len(values) <= 1, f"{name} of a sweep is {' and '.join(map(str, values))}; run a sweep for each.")
    most = sum(grid.trials * math.prod(max(1, len(getattr(grid, info.axis))) for info in AXES) for grid in grids)
    require(
        most <= MOST_TRIALS,
        f"the sweep has up to {most:,} trials, and at most {MOST_TRIALS:,} are allowed in one folder; share them "
        "out over several: other seeds, or other scenarios, in each.",
    )


def load_all(grids: Sequence[SweepSettings]) -> Mapping[str, Scenario]:
    """Every scenario of a sweep by what was given for it.

    Raises:
        InputError: A scenario cannot be loaded, or two have the same name.
    """
    loaded = {source: load_scenario(source) for grid in grids for source in grid.scenarios}
    names = [scenario.name for scenario in loaded.values()]
    for name in names:
        require(
            not UNSHOWN.search(name),
            f"the scenario name {name!r} has control characters or half letters; rename its file.",
        )
        require(
            names.count(name) <= 1,
            f"two scenarios called '{name}' were given; rows name them, so rename one of the files.",
        )
    return loaded


def units(grids: Sequence[SweepSettings], loaded: Mapping[str, Scenario], salt: Salt | None = None) -> Iterator[Batch]:
    """All the work of a sweep, each trial once, seeds first, so that every cell of an interrupted sweep is about
    equally full.

    The oracle meets neither noise nor carelessness: it runs once per seed, grasp and robot error, recorded at level 0,
    carelessness 0 and the first noise model or eye. Plans without a corrector ask for no contacts: they are
    recorded with relations as given. Methods that cannot ask to see operations again are recorded with no looks, those
    without `+feel` with the usual sensor and stated error.
    """
    for seed in sorted({seed for grid in grids for seed in range(grid.seed, grid.seed + grid.trials)}):
        those = [grid for grid in grids if grid.seed <= seed < grid.seed + grid.trials]
        for source, scenario in loaded.items():
            yield from _units(those, source, scenario, seed, salt)


def described(grids: Sequence[SweepSettings], loaded: Mapping[str, Scenario]) -> list[dict[str, Any]]:
    """The grids as they stand in `run.json`, with scenarios by name and clearances filled in."""
    forms = []
    for grid in grids:
        values = {key: list(value) if isinstance(value, tuple) else value for key, value in asdict(grid).items()}
        own = {loaded[source].name: loaded[source].clearance_mm for source in grid.scenarios}
        clearances = {name: list(grid.clearances_mm or (clearance,)) for name, clearance in own.items()}
        forms.append({**values, "scenarios": list(own), "clearances_mm": clearances})
    return forms


def _units(
    grids: Sequence[SweepSettings], source: str, scenario: Scenario, seed: int, salt: Salt | None
) -> Iterator[Batch]:
    """The trials of a scenario and a seed, by what they share."""
    together = grouped(
        ((clearance, trial.careless, trial.eye), trial)
        for grid in grids
        if source in grid.scenarios
        for clearance in grid.clearances_mm or (scenario.clearance_mm,)
        for trial in _trials(grid, source, clearance, seed, salt)
    )
    return (tuple(dict.fromkeys(trials)) for trials in together.values())


def _trials(
    grid: SweepSettings, source: str, clearance_mm: float, seed: int, salt: Salt | None
) -> Iterator[TrialSettings]:
    """Every combination of a grid as what its method meets of it; some are the same."""
    same: dict[str, Any] = {name: getattr(grid, name) for name in SHARED}
    same |= {"scenario": source, "clearance_mm": clearance_mm, "seed": seed, "salt": salt}
    values = [getattr(grid, info.axis) or (RANGE,) for info in _VARIED]
    for combination in product(*values):
        asked = dict(zip((info.name for info in _VARIED), combination, strict=True))
        yield TrialSettings(**same, **_met(asked, grid))


def _met(asked: dict[str, Any], grid: SweepSettings) -> dict[str, Any]:
    """What a method meets of the settings that were asked for, in place of the others what is usual."""
    method = asked["method"]
    if knows_truth(method):
        asked |= {"level": 0.0, "careless": 0.0, "eye": grid.eyes[0], "noise": grid.noises[0] if grid.noises else RANGE}
    if asked["eye"] == RANGE:
        asked["noise"] = RANGE
    for name, is_met in _MET_BY_SOME.items():
        if not is_met(method):
            asked[name] = SETTINGS[name].default
    asked["level_mm"], asked["level_deg"] = level_pair(asked.pop("level"), asked["eye"])
    return asked


def _plain(value: Any) -> Any:
    """Numbers as rows spell them, whatever kind of number was given: 2.0 for 2, and 0.0 for -0.0."""
    if isinstance(value, Real) and not isinstance(value, bool):
        return float(value) + 0.0
    if isinstance(value, Sequence) and not isinstance(value, str):
        return tuple(map(_plain, value))
    return value
