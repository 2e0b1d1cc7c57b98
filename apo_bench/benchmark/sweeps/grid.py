"""The grids of a sweep: every combination of settings, as batches of trials."""

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field, make_dataclass, replace
from itertools import product
from numbers import Integral, Real
from typing import Any, final

import numpy as np

from apo_bench.errors import require, shown
from apo_bench.io import UNSHOWN, group_by
from apo_bench.records import (
    DEPTH_CAMERA,
    NOISE_LEVEL,
    SETTINGS,
    SecretSeed,
    SettingInfo,
    TrialConfig,
    affects,
    check,
    check_grip,
    check_together,
    knows_truth,
    parse_noise_level,
    probes,
    refuse_noise,
)
from apo_bench.scenario import Scenario, load_scenario

MOST_TRIALS = 1_000_000
"""Largest number of trials of one sweep, whose settings need half a kilobyte of memory each."""
AXES: tuple[SettingInfo, ...] = tuple(info for info in (*SETTINGS.values(), NOISE_LEVEL) if info.axis)
"""The settings that may have several values in a sweep."""
_MAY_BE_EMPTY = ("clearance_mm", "noise")  # settings whose default depends on the scenario or the pose source
SHARED: tuple[str, ...] = tuple(info.name for info in SETTINGS.values() if info.shared)
"""The settings that all trials of a sweep share."""
EACH = ":*"
"""Ending of a scenario, `generated:FAMILY:*`, that draws another assembly for each trial."""
_MOST_GENERATED = 10**15
"""The seed of a generated scenario has at most 15 digits."""
_UNUSED_BITS = 11
"""A drawn seed has 53 of 64 bits, so that every JSON reader keeps it exact."""
# the scenario and its clearance are combined separately
_VARIED = tuple(info for info in AXES if info.name not in ("scenario", "clearance_mm"))
Batch = tuple[TrialConfig, ...]
"""Trials that share layout and demonstration, and run in one process."""


_FIRST = ("scenario", "noise_level", "human_error_scale", "method")
"""The settings that may be positional arguments."""


def _list_axis_fields() -> Iterator[tuple[str, Any, Any]]:
    """Yield name, type and field of each setting that a sweep may vary, then of each that its trials share."""
    for info in sorted(AXES, key=lambda info: _FIRST.index(info.name) if info.name in _FIRST else len(_FIRST)):
        default = () if info.name in _MAY_BE_EMPTY else info.swept or (info.default,)
        yield info.name, tuple[Any, ...], field(default=default, kw_only=info.name not in _FIRST)
    for name in SHARED:
        yield name, Any, field(default=SETTINGS[name].default, kw_only=True)


_Axes: Any = make_dataclass("_Axes", _list_axis_fields(), frozen=True)
"""Base class with one field for each setting that a sweep may vary, and for each that its trials share."""


@final
@dataclass(frozen=True)
class SweepConfig(_Axes):  # type: ignore[misc]  # made from the settings, so that a new one is in sweeps as well
    """The settings of a sweep, which runs every combination with the same seeds.

    Every setting of `TrialConfig` is a keyword; it takes one value or several. Noise levels are numbers, or pairs of mm
    and degrees; `noise_mm` and `noise_deg` may be given in their place. Settings that do not affect a method, such as
    the noise of `oracle`, are recorded for it as their defaults, and such a trial runs once.

    Examples:
        >>> import apo_bench
        >>> grid = apo_bench.SweepConfig("stick_in_tower", noise_level=[0.5, 1], method="contact", trials=10)
        >>> grid.noise_level
        (0.5, 1.0)
    """

    scenario: tuple[str, ...]
    """Names, or paths of scenario files."""
    clearance_mm: tuple[float, ...] = field(default=(), kw_only=True)
    """Clearances per side; empty: that of each scenario."""
    noise: tuple[str, ...] = field(default=(), kw_only=True)
    """Noise models; empty: `isotropic`, or none if `depth-camera` is the only pose source."""
    noise_mm: tuple[float, ...] = field(default=(), kw_only=True)
    """In place of `noise_level`: standard deviations of positions."""
    noise_deg: tuple[float, ...] = field(default=(), kw_only=True)
    """In place of `noise_level`: standard deviations of rotation vectors."""
    trials: int = field(default=100, kw_only=True)
    """Number of trials of each combination."""
    seed: int = field(default=0, kw_only=True)
    """The first seed; the others follow."""
    independent_seeds: bool = field(default=False, kw_only=True)
    """Whether each condition has other seeds, the same for every method, drawn from `seed`; by default
    all combinations have the same seeds."""

    def __post_init__(self) -> None:
        if self.noise_mm != () or self.noise_deg != ():
            # one of the two may be missing
            by_axis = [convert_to_tuple(values) or (1.0,) for values in (self.noise_mm, self.noise_deg)]
            object.__setattr__(self, "noise_level", tuple(product(*by_axis)))
            object.__setattr__(self, "noise_mm", ())
            object.__setattr__(self, "noise_deg", ())
        for info in AXES:
            given = convert_to_tuple(getattr(self, info.name))
            entries = given if info.is_whole else map(_to_plain, given)
            values = tuple(dict.fromkeys(map(info.spelled, entries) if info.spelled else entries))
            require(
                values or info.name in _MAY_BE_EMPTY,
                f"no {info.words} was given for the sweep; at least one is needed.",
            )
            object.__setattr__(self, info.name, values)
            for value in () if info is NOISE_LEVEL else values:  # pairs are checked below
                info.check(value)
        for name in SHARED:
            check(name, getattr(self, name))
        require(
            isinstance(self.trials, Integral) and 1 <= self.trials <= MOST_TRIALS,
            f"trials must be a whole number from 1 to {MOST_TRIALS}, got {shown(self.trials)}.",
        )
        object.__setattr__(self, "trials", int(self.trials))
        check("seed", self.seed)
        check("seed", self.seed + self.trials - 1)
        if set(self.pose_source) == {DEPTH_CAMERA}:
            refuse_noise(*self.noise)
        else:
            object.__setattr__(self, "noise", self.noise or (TrialConfig.noise,))
        # each noise level must fit each pose source
        for level, source in product(self.noise_level, self.pose_source):
            parse_noise_level(level, source)
        check_together(self.fidelity, *self.grasp)
        check_grip(any(map(probes, self.method)), *self.grasp)


def convert_to_tuple(values: Any) -> tuple[Any, ...]:
    """Return one value or several as a tuple: a text is one value, and a list within a list becomes a pair."""
    several = values if isinstance(values, Iterable) and not isinstance(values, str) else (values,)
    return tuple(tuple(each) if isinstance(each, list) else each for each in several)


def _to_plain(value: Any) -> Any:
    """Convert numbers to floats as in records: 2.0 for 2, and 0.0 for -0.0; other values stay."""
    if isinstance(value, Real) and not isinstance(value, bool):
        return float(value) + 0.0
    if isinstance(value, Sequence) and not isinstance(value, str):
        return tuple(map(_to_plain, value))
    return value


def check_grids(grids: Sequence[SweepConfig]) -> None:
    """Raise an `InputError` unless the grids can be one sweep.

    There must be a grid, all must share arm, time step and fidelity, and there may not be too many trials. Independent
    seeds are drawn from one seed.
    """
    require(grids, "no grid was given for the sweep; at least one is needed.")
    for name in SHARED:
        values = {getattr(grid, name): None for grid in grids}
        require(len(values) == 1, f"{name} of a sweep is {' and '.join(map(str, values))}; run a sweep for each.")
    drawn = {(grid.independent_seeds, grid.seed * grid.independent_seeds) for grid in grids}
    for grid in grids:
        each = next((name for name in grid.scenario if name.endswith(EACH)), None)
        require(
            each is None or (grid.independent_seeds and each.startswith("generated:")),
            f"the scenario '{each}' was given; give `generated:FAMILY:*`, with independent seeds.",
        )
    require(len(drawn) == 1, "independent_seeds and their seed are those of the whole sweep; give each of them once.")
    most = sum(grid.trials * math.prod(max(1, len(getattr(grid, info.name))) for info in AXES) for grid in grids)
    require(
        most <= MOST_TRIALS,
        f"the sweep has up to {most:,} trials, and at most {MOST_TRIALS:,} are allowed in one folder; share them "
        "out over several: other seeds, or other scenarios, in each.",
    )


def load_all(grids: Sequence[SweepConfig]) -> Mapping[str, Scenario]:
    """Load every scenario of a sweep; returns name or path -> scenario.

    Raises:
        InputError: A scenario cannot be loaded, or two have the same name.
    """
    loaded = {source: load_scenario(source) for source in _list_sources(grids)}
    names = [scenario.name for scenario in loaded.values()]
    for name in names:
        require(
            not UNSHOWN.search(name),
            f"the scenario name {name!r} has control characters or half letters; rename its file.",
        )
        require(
            names.count(name) <= 1,
            f"two scenarios called '{name}' were given; records name them, so rename one of the files.",
        )
    return loaded


def list_work_units(
    grids: Sequence[SweepConfig], loaded: Mapping[str, Scenario], secret_seed: SecretSeed | None = None
) -> Iterator[Batch]:
    """Yield all trials of a sweep, each once, in batches ordered by seed, or by the number of the trial.

    By this order an interrupted sweep has about equally many trials of each condition.

    Noise and human error do not affect the oracle. So it runs once per seed, grasp and robot error.
    Its record has noise level 0, human error scale 0, and the first noise model or pose source. For other methods,
    settings without effect have their defaults.
    """
    if any(grid.independent_seeds for grid in grids):
        yield from _independent_units(grids, loaded, secret_seed)
        return
    for seed in sorted({seed for grid in grids for seed in range(grid.seed, grid.seed + grid.trials)}):
        those = [grid for grid in grids if grid.seed <= seed < grid.seed + grid.trials]  # grids that have this seed
        for source, scenario in loaded.items():
            same = {"scenario": source, "seed": seed, "secret_seed": secret_seed}
            # layout and demonstration depend on the keys of this grouping
            together = group_by(
                ((trial.clearance_mm, trial.human_error_scale, trial.pose_source), trial)
                for grid in those
                if source in grid.scenario
                for clearance_mm in grid.clearance_mm or (scenario.clearance_mm,)
                for trial in _list_trials(grid, same | {"clearance_mm": clearance_mm})
            )
            # without trials that several grids share
            yield from (tuple(dict.fromkeys(trials)) for trials in together.values())


def draw_seed(seed: int, condition: int, trial: int) -> int:
    """Return the seed of a trial that is independent of those of all other trials and conditions, below 2^53.

    Args:
        seed: The seed of the sweep.
        condition: Number of the condition, from 0.
        trial: Number of the trial in its condition, from 0.
    """
    drawn = np.random.SeedSequence(seed, spawn_key=(condition, trial)).generate_state(1, np.uint64)
    return int(drawn[0]) >> _UNUSED_BITS


def list_conditions(grids: Sequence[SweepConfig]) -> dict[SweepConfig, list[SweepConfig]]:
    """Return each condition of a sweep, in the order of its number -> the grids of one condition that have it.

    A condition is a combination of all settings but the method; as a key it has one method and one trial.
    """
    own: dict[str, Any] = {"method": ("oracle",), "trials": 1}
    return group_by((replace(one, **own), one) for grid in grids for one in _split(grid))


def _split(grid: SweepConfig) -> Iterator[SweepConfig]:
    """Yield a grid for each combination of all settings but the method."""
    names = [info.name for info in AXES if info.name != "method"]
    each: list[list[tuple[Any, ...]]] = [[(value,) for value in getattr(grid, name)] or [()] for name in names]
    for values in product(*each):
        own: dict[str, Any] = dict(zip(names, values, strict=True))
        yield replace(grid, **own)


def _independent_units(
    grids: Sequence[SweepConfig], loaded: Mapping[str, Scenario], secret_seed: SecretSeed | None
) -> Iterator[Batch]:
    """Yield all trials of a sweep with independent seeds; those of one condition and number have one seed."""
    conditions = list(list_conditions(grids).values())
    for trial in range(max(grid.trials for grid in grids)):
        for number, ones in enumerate(conditions):
            seed = draw_seed(grids[0].seed, number, trial)
            batch: dict[TrialConfig, None] = {}
            for one in ones:
                source = _draw_source(one.scenario[0], seed)
                same = {"scenario": source, "seed": seed, "secret_seed": secret_seed}
                clearances = one.clearance_mm or (loaded[source].clearance_mm,)
                if trial < one.trials:
                    batch |= dict.fromkeys(_list_trials(one, same | {"clearance_mm": clearances[0]}))
            if batch:
                yield tuple(batch)


def _list_sources(grids: Sequence[SweepConfig]) -> Iterator[str]:
    """Yield the scenarios of all trials by name or path, with those that a seed draws."""
    if not any(grid.independent_seeds for grid in grids):
        yield from (source for grid in grids for source in grid.scenario)
        return
    for number, ones in enumerate(list_conditions(grids).values()):
        given = ones[0].scenario[0]
        trials = max(one.trials for one in ones) if given.endswith(EACH) else 1
        for trial in range(trials):
            yield _draw_source(given, draw_seed(ones[0].seed, number, trial))


def _draw_source(given: str, seed: int) -> str:
    """Return a scenario: with the ending `:*`, which needs independent seeds, another one for each trial."""
    return f"{given.removesuffix('*')}{seed % _MOST_GENERATED}" if given.endswith(EACH) else given


def describe_grids(grids: Sequence[SweepConfig], loaded: Mapping[str, Scenario]) -> list[dict[str, Any]]:
    """Return the grids for `run.json`, with scenarios by name and clearances filled in."""
    forms = []
    for grid in grids:
        values = {key: list(value) if isinstance(value, tuple) else value for key, value in asdict(grid).items()}
        names = {source: loaded[source].name if source in loaded else source for source in grid.scenario}
        own = {
            name: loaded[source].clearance_mm if source in loaded else TrialConfig.clearance_mm
            for source, name in names.items()
        }
        clearances = {name: list(grid.clearance_mm or (clearance,)) for name, clearance in own.items()}
        forms.append({**values, "scenario": list(own), "clearance_mm": clearances})
    return forms


def _list_trials(grid: SweepConfig, same: Mapping[str, Any]) -> Iterator[TrialConfig]:
    """Yield every combination of a grid; settings that do not affect the method have their defaults.

    Args:
        same: Settings that all of these trials share.
    """
    shared = {name: getattr(grid, name) for name in SHARED}
    names = [info.name for info in _VARIED]
    for combination in product(*(getattr(grid, name) or (DEPTH_CAMERA,) for name in names)):
        values = dict(zip(names, combination, strict=True))
        method = values["method"]
        values |= {name: SETTINGS[name].default for name in names if not affects(name, method)}
        if knows_truth(method):  # noise and human error do not affect it
            first = {"pose_source": grid.pose_source[0], "noise": (*grid.noise, DEPTH_CAMERA)[0]}
            values |= {"noise_level": 0.0, "human_error_scale": 0.0, **first}
        if values["pose_source"] == DEPTH_CAMERA:
            values["noise"] = DEPTH_CAMERA
        mm, deg = parse_noise_level(values.pop("noise_level"), values["pose_source"])
        yield TrialConfig(**same, **shared, **values, noise_mm=mm, noise_deg=deg)
