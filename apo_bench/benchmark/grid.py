"""The grid of a sweep: which trials there are, and which of them share a demonstration."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any, final

from apo_bench.benchmark.spec import (
    RANGE,
    USUAL,
    TrialSpec,
    check_careless,
    check_clearance,
    check_eye,
    check_fidelity,
    check_level,
    check_method,
    check_seed,
    checked_relations,
    knows_relations,
    refuse_noise,
)
from apo_bench.errors import InputError, unknown
from apo_bench.scenario import Scenario
from apo_bench.scenario_file import load_scenario

LEVELS = (0.0, 0.1, 0.25, 0.5, 1.0, 2.0, 4.0)
METHODS = ("oracle", "none", "paper", "contact")
LARGEST_TRIALS = 1_000_000
AXES = ("scenarios", "levels", "careless", "methods", "clearances_mm", "noises", "relations", "eyes", "grasps")
"""What a sweep has several of."""

Key = tuple[str, float, int, float, float, float, str, str, str, str]
"""What tells one trial of a sweep from another: the columns `KEY` of its row."""
KEY = (
    *("scenario", "clearance_mm", "seed", "careless", "level", "level_deg"),
    *("noise", "relations", "grasp", "method"),
)


@final
@dataclass(frozen=True)
class SweepSpec:
    """What a sweep varies; it runs every combination, with the same seeds in every cell."""

    scenarios: tuple[str, ...]
    """Names, or paths of scenario files."""
    levels: tuple[float, ...] = LEVELS
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
    """What correctors are told of the contacts, as in `TrialSpec`."""
    eyes: tuple[str, ...] = ("noise",)
    """As in `TrialSpec`; noise models are those of the eye `noise`."""
    grasps: tuple[str, ...] = ("friction",)
    """`friction`, or `weld` for an ideal gripper."""
    arm: str = "six_axis"
    timestep_s: float = 0.001
    fidelity: str = "full"
    """As in `TrialSpec`; one for all trials, like the arm and the time step."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "relations", tuple(map(checked_relations, self.relations)))
        for name in AXES:
            object.__setattr__(self, name, tuple(dict.fromkeys(getattr(self, name))))
        for name in AXES:
            if name not in ("clearances_mm", "noises") and not getattr(self, name):
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
        for level in self.levels:
            check_level(level, eye="noise" if drawn else RANGE)
        for careless in self.careless:
            check_careless(careless)
        for clearance in self.clearances_mm:
            check_clearance(clearance)
        for method in self.methods:
            check_method(method)
        for grasp in self.grasps:
            check_grasp(grasp)
        check_fidelity(self.fidelity)


@final
@dataclass(frozen=True)
class Unit:
    """The trials of one scenario, clearance and seed: they share layouts and demonstrations."""

    trials: tuple[TrialSpec, ...]


def load_all(spec: SweepSpec) -> Mapping[str, Scenario]:
    """Every scenario of a sweep by what was given for it.

    Raises:
        InputError: A scenario cannot be loaded, or two have the same name.
    """
    loaded = {given: load_scenario(given) for given in spec.scenarios}
    names = [scenario.name for scenario in loaded.values()]
    for name in names:
        if names.count(name) > 1:
            raise InputError(f"two scenarios called '{name}' were given; rows name them, so rename one of the files.")
    return loaded


def units(spec: SweepSpec, loaded: Mapping[str, Scenario]) -> tuple[Unit, ...]:
    """All the work of a sweep, seeds first, so that an interrupted sweep has every cell about equally full.

    The oracle meets neither noise nor carelessness: it runs once per seed and grasp, recorded at level 0,
    carelessness 0 and the first noise model or eye. Neither it nor `none` asks what touches what: both are recorded
    with relations as given.
    """
    return tuple(
        Unit(_trials(spec, given, clearance, seed))
        for seed in range(spec.seed, spec.seed + spec.trials)
        for given, scenario in loaded.items()
        for clearance in spec.clearances_mm or (scenario.clearance_mm,)
    )


def described(spec: SweepSpec, loaded: Mapping[str, Scenario]) -> dict[str, Any]:
    """The specification as it stands in `run.json`, with scenarios by name and clearances filled in."""
    values = {key: list(value) if isinstance(value, tuple) else value for key, value in asdict(spec).items()}
    names = {given: scenario.name for given, scenario in loaded.items()}
    clearances = {s.name: list(spec.clearances_mm or (s.clearance_mm,)) for s in loaded.values()}
    return {**values, "scenarios": [names[given] for given in spec.scenarios], "clearances_mm": clearances}


def trial_key(trial: TrialSpec, name: str) -> Key:
    """The key of a trial whose scenario is called `name`."""
    t = trial
    where = (name, t.clearance_mm, t.seed, t.careless, t.level_mm, t.level_deg)
    return (*where, t.noise, t.relations, t.grasp, t.method)


def row_key(row: Mapping[str, Any]) -> Key:
    """The key of the trial that a row is of."""
    return (
        *(row["scenario"], row["clearance_mm"], row["seed"], row["careless"], row["level"]),
        *(row["level_deg"], row["noise"], row["relations"], row["grasp"], row["method"]),
    )


def _trials(spec: SweepSpec, given: str, clearance_mm: float, seed: int) -> tuple[TrialSpec, ...]:
    def trial(
        method: str, level: float, careless: float, seen: tuple[str, str], relations: str, grasp: str
    ) -> TrialSpec:
        return TrialSpec(
            scenario=given,
            level_mm=level,
            level_deg=level,
            careless=careless,
            clearance_mm=clearance_mm,
            noise=seen[1],
            grasp=grasp,
            arm=spec.arm,
            method=method,
            seed=seed,
            timestep_s=spec.timestep_s,
            relations=relations,
            eye=seen[0],
            fidelity=spec.fidelity,
        )

    ways = [way for eye in spec.eyes for way in _ways(eye, spec.noises)]
    ceiling = tuple(
        trial(m, 0.0, 0.0, ways[0], "given", grasp) for m in spec.methods if m == "oracle" for grasp in spec.grasps
    )
    rest = tuple(
        trial(method, level, careless, seen, relations, grasp)
        for grasp in spec.grasps
        for careless in spec.careless
        for level in spec.levels
        for seen in ways
        for method in spec.methods
        if method != "oracle"
        for relations in (spec.relations if knows_relations(method) else ("given",))
    )
    return ceiling + rest


def check_grasp(grasp: str) -> None:
    """Raise an `InputError` unless there is such a grasp."""
    from apo_bench.simulation.scene import GRASPS

    if grasp not in GRASPS:
        raise InputError(unknown("grasp", str(grasp), GRASPS))


def _ways(eye: str, noises: tuple[str, ...]) -> list[tuple[str, str]]:
    """Eye and noise model, of every way of seeing that an eye stands for."""
    return [(eye, RANGE)] if eye == RANGE else [(eye, noise) for noise in noises]
