"""The grids of a sweep: which trials there are, and which of them share a demonstration."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from itertools import product
from numbers import Real
from typing import Any, final

from apo_bench.errors import InputError, unknown
from apo_bench.io.plain_text import UNSHOWN
from apo_bench.records.key import Key
from apo_bench.records.method import checked_method, knows_relations, knows_truth
from apo_bench.records.relations import checked_relations
from apo_bench.records.salt import Salt
from apo_bench.records.settings import (
    RANGE,
    USUAL,
    TrialSettings,
    check_careless,
    check_clearance,
    check_eye,
    check_fidelity,
    check_level,
    check_seed,
    level_pair,
    refuse_noise,
)
from apo_bench.scenario.file import load_scenario
from apo_bench.scenario.scenario import Scenario

LEVELS = (0.0, 0.1, 0.25, 0.5, 1.0, 2.0, 4.0)
METHODS = ("oracle", "none", "paper", "contact")
LARGEST_TRIALS = 1_000_000
MOST_TRIALS = 1_000_000
"""Of all cells of a sweep together: their specifications are held in memory, half a kilobyte each."""
AXES = ("scenarios", "levels", "careless", "methods", "clearances_mm", "noises", "relations", "eyes", "grasps")
"""What a sweep has several of."""
MAY_BE_EMPTY = ("clearances_mm", "noises")
SHARED = ("arm", "timestep_s", "fidelity")
"""What all grids of a sweep have in common, so that no key tells trials apart by it."""

Level = float | tuple[float, float]
"""Mm and degrees, or the two apart."""


@final
@dataclass(frozen=True)
class SweepSpec:
    """What a sweep varies; it runs every combination, with the same seeds in every cell."""

    scenarios: tuple[str, ...]
    """Names, or paths of scenario files."""
    levels: tuple[Level, ...] = LEVELS
    careless: tuple[float, ...] = (0.0, 1.0)
    methods: tuple[str, ...] = METHODS
    clearances_mm: tuple[float, ...] = ()
    """Empty stands for each scenario's own."""
    trials: int = 100
    seed: int = 0
    """The first of the seeds."""
    noises: tuple[str, ...] = ()
    """Empty stands for `isotropic`, and for none where no eye draws any."""
    relations: tuple[str, ...] = ("given",)
    """What correctors are told of the contacts, as in `TrialSettings`."""
    eyes: tuple[str, ...] = ("noise",)
    """As in `TrialSettings`; noise models are those of the eye `noise`."""
    grasps: tuple[str, ...] = ("friction",)
    """`friction`, or `weld` for an ideal gripper."""
    arm: str = "six_axis"
    timestep_s: float = 0.001
    fidelity: str = "full"
    """As in `TrialSettings`; one for all trials, like the arm and the time step."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "relations", tuple(map(checked_relations, self.relations)))
        object.__setattr__(self, "methods", tuple(map(checked_method, self.methods)))
        for name in AXES:
            object.__setattr__(self, name, tuple(dict.fromkeys(map(_plain, getattr(self, name)))))
        for name in AXES:
            if name not in MAY_BE_EMPTY and not getattr(self, name):
                raise InputError(f"no {name} were given for the sweep; at least one is needed.")
        if not 1 <= self.trials <= LARGEST_TRIALS:
            raise InputError(f"{self.trials} trials were given; a whole number from 1 to {LARGEST_TRIALS} is allowed.")
        check_seed(self.seed)
        check_seed(self.seed + self.trials - 1)
        for eye in self.eyes:
            check_eye(eye)
        drawn = set(self.eyes) != {RANGE}
        if self.noises and not drawn:
            refuse_noise(*self.noises)
        object.__setattr__(self, "noises", self.noises or (USUAL,) * drawn)
        for level, eye in product(self.levels, self.eyes):
            if isinstance(level, tuple):
                level_pair(level, eye)
            else:
                check_level(level, eye=eye)
        for careless in self.careless:
            check_careless(careless)
        for clearance in self.clearances_mm:
            check_clearance(clearance)
        for name in (*self.noises, *self.methods, *self.relations, self.arm):
            if UNSHOWN.search(name):
                raise InputError(
                    f"the name {name!r} was given, which has control characters or half letters; use another one."
                )
        for grasp in self.grasps:
            check_grasp(grasp)
        check_fidelity(self.fidelity, *self.grasps)


@final
@dataclass(frozen=True)
class Unit:
    """Trials of one scenario, clearance, seed, carelessness and eye: they share layout and demonstration."""

    trials: tuple[TrialSettings, ...]


def check_grids(grids: Sequence[SweepSpec]) -> None:
    """Raise an `InputError` unless there is a grid, all have the same arm, time step and fidelity, and they are not
    larger than can be held."""
    if not grids:
        raise InputError("no grid was given for the sweep; at least one is needed.")
    for name in SHARED:
        given = {getattr(grid, name): None for grid in grids}
        if len(given) > 1:
            raise InputError(f"{name} of a sweep is {' and '.join(map(str, given))}; run a sweep for each.")
    most = sum(grid.trials * _per_seed(grid) for grid in grids)
    if most > MOST_TRIALS:
        raise InputError(
            f"the sweep has up to {most:,} trials, and at most {MOST_TRIALS:,} are allowed in one folder; share them "
            "out over several: other seeds, or other scenarios, in each."
        )


def load_all(grids: Sequence[SweepSpec]) -> Mapping[str, Scenario]:
    """Every scenario of a sweep by what was given for it.

    Raises:
        InputError: A scenario cannot be loaded, or two have the same name.
    """
    loaded = {given: load_scenario(given) for grid in grids for given in grid.scenarios}
    names = [scenario.name for scenario in loaded.values()]
    for name in names:
        if UNSHOWN.search(name):
            raise InputError(f"the scenario name {name!r} has control characters or half letters; rename its file.")
        if names.count(name) > 1:
            raise InputError(f"two scenarios called '{name}' were given; rows name them, so rename one of the files.")
    return loaded


def units(grids: Sequence[SweepSpec], loaded: Mapping[str, Scenario], salt: Salt | None = None) -> Iterator[Unit]:
    """All the work of a sweep, each trial once, seeds first, so that every cell of an interrupted sweep is about
    equally full.

    The oracle meets neither noise nor carelessness: it runs once per seed and grasp, recorded at level 0,
    carelessness 0 and the first noise model or eye. Neither it nor `none` asks what touches what: both are recorded
    with relations as given.
    """
    for seed in sorted({seed for grid in grids for seed in range(grid.seed, grid.seed + grid.trials)}):
        those = [grid for grid in grids if grid.seed <= seed < grid.seed + grid.trials]
        for given, scenario in loaded.items():
            yield from _units(those, given, scenario, seed, salt)


def described(grids: Sequence[SweepSpec], loaded: Mapping[str, Scenario]) -> list[dict[str, Any]]:
    """The grids as they stand in `run.json`, with scenarios by name and clearances filled in."""
    return [_described(grid, loaded) for grid in grids]


def trial_key(trial: TrialSettings, name: str) -> Key:
    """The key of a trial whose scenario is called `name`."""
    t = trial
    where = (name, t.clearance_mm, t.seed, t.careless, t.level_mm, t.level_deg)
    return (*where, t.noise, t.relations, t.grasp, t.method)


def check_grasp(grasp: str) -> None:
    """Raise an `InputError` unless there is such a grasp."""
    from apo_bench.simulation.scene.scene import GRASPS

    if grasp not in GRASPS:
        raise InputError(unknown("grasp", str(grasp), GRASPS))


def _per_seed(grid: SweepSpec) -> int:
    """How many trials a grid has for one seed, if none is the same as another."""
    ways = sum(len(_ways(eye, grid.noises)) for eye in grid.eyes)
    told = sum(
        len(grid.relations) if knows_relations(method) else 1 for method in grid.methods if not knows_truth(method)
    )
    trials = len(grid.careless) * len(grid.levels) * ways * told + sum(map(knows_truth, grid.methods))
    return len(grid.scenarios) * max(1, len(grid.clearances_mm)) * len(grid.grasps) * trials


def _units(grids: Sequence[SweepSpec], given: str, scenario: Scenario, seed: int, salt: Salt | None) -> Iterator[Unit]:
    """The trials of a scenario and a seed, by what they share."""
    together: dict[tuple[float, float, str], dict[TrialSettings, None]] = {}
    for grid in grids:
        for clearance in (grid.clearances_mm or (scenario.clearance_mm,)) if given in grid.scenarios else ():
            for trial in _trials(grid, given, clearance, seed, salt):
                together.setdefault((clearance, trial.careless, trial.eye), {})[trial] = None
    return (Unit(tuple(trials)) for trials in together.values())


def _trials(grid: SweepSpec, given: str, clearance_mm: float, seed: int, salt: Salt | None) -> Iterator[TrialSettings]:
    def trial(
        method: str, level: Level, careless: float, way: tuple[str, str], relations: str, grasp: str
    ) -> TrialSettings:
        mm, deg = level_pair(level, way[0])
        return TrialSettings(
            scenario=given,
            level_mm=mm,
            level_deg=deg,
            careless=careless,
            clearance_mm=clearance_mm,
            noise=way[1],
            grasp=grasp,
            arm=grid.arm,
            method=method,
            seed=seed,
            timestep_s=grid.timestep_s,
            relations=relations,
            eye=way[0],
            fidelity=grid.fidelity,
            salt=salt,
        )

    ways = [way for eye in grid.eyes for way in _ways(eye, grid.noises)]
    for method, grasp in product(filter(knows_truth, grid.methods), grid.grasps):
        yield trial(method, 0.0, 0.0, ways[0], "given", grasp)
    for grasp, careless, level, way, method in product(grid.grasps, grid.careless, grid.levels, ways, grid.methods):
        if not knows_truth(method):
            for relations in grid.relations if knows_relations(method) else ("given",):
                yield trial(method, level, careless, way, relations, grasp)


def _ways(eye: str, noises: tuple[str, ...]) -> list[tuple[str, str]]:
    """Eye and noise model, of every way of seeing that an eye stands for."""
    return [(eye, RANGE)] if eye == RANGE else [(eye, noise) for noise in noises]


def _described(grid: SweepSpec, loaded: Mapping[str, Scenario]) -> dict[str, Any]:
    values = {key: list(value) if isinstance(value, tuple) else value for key, value in asdict(grid).items()}
    own = {loaded[given].name: loaded[given].clearance_mm for given in grid.scenarios}
    clearances = {name: list(grid.clearances_mm or (clearance,)) for name, clearance in own.items()}
    return {**values, "scenarios": list(own), "clearances_mm": clearances}


def _plain(value: Any) -> Any:
    """Numbers as rows spell them, whatever kind of number was given: 2.0 for 2, and 0.0 for -0.0."""
    if isinstance(value, Real) and not isinstance(value, bool):
        return float(value) + 0.0
    if isinstance(value, Sequence) and not isinstance(value, str):
        return tuple(map(_plain, value))
    return value
