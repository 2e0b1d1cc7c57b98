"""The grids of a sweep: which trials there are, and which of them share a demonstration."""

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field, make_dataclass
from itertools import product
from numbers import Integral, Real
from typing import Any, final

from apo_bench.errors import require, require_text
from apo_bench.io import UNSHOWN, grouped
from apo_bench.records import (
    DEPTH_CAMERA,
    NOISE_LEVEL,
    SETTINGS,
    SecretSeed,
    SettingInfo,
    TrialConfig,
    check,
    check_grip,
    check_together,
    knows_truth,
    may_reobserve,
    noise_pair,
    probes,
    refuse_noise,
    uses_contacts,
)
from apo_bench.scenario import Scenario, load_scenario

MOST_TRIALS = 1_000_000
"""Largest number of trials of one sweep: their settings are held in memory, half a kilobyte each."""
AXES: tuple[SettingInfo, ...] = tuple(info for info in (*SETTINGS.values(), NOISE_LEVEL) if info.axis)
"""The settings of which a sweep may have several values."""
_MAY_BE_EMPTY = ("clearance_mm", "noise")
SHARED: tuple[str, ...] = tuple(info.name for info in SETTINGS.values() if info.shared)
"""The settings that all trials of a sweep share."""
_VARIED = tuple(info for info in AXES if info.name not in ("scenario", "clearance_mm"))
_MET_BY_SOME = {
    "contact_source": uses_contacts,
    "max_reobservations": may_reobserve,
    "ft_sensor": probes,
    "assumed_robot_error": probes,
}
"""Setting -> whether it affects a method."""
Batch = tuple[TrialConfig, ...]
"""Trials that share layout and demonstration."""


_FIRST = ("scenario", "noise_level", "human_error_scale", "method")
"""The settings that may be given by position."""


def _axis_fields() -> Iterator[tuple[str, Any, Any]]:
    for info in sorted(AXES, key=lambda info: _FIRST.index(info.name) if info.name in _FIRST else len(_FIRST)):
        default = () if info.name in _MAY_BE_EMPTY else info.swept or (info.default,)
        yield info.name, tuple[Any, ...], field(default=default, kw_only=info.name not in _FIRST)
    for name in SHARED:
        yield name, Any, field(default=SETTINGS[name].default, kw_only=True)


_Axes: Any = make_dataclass("_Axes", _axis_fields(), frozen=True)
"""One field for each setting that a sweep may vary, and for each that its trials share."""


@final
@dataclass(frozen=True)
class SweepConfig(_Axes):  # type: ignore[misc]  # made from the settings, so that a new one is in sweeps as well
    """The settings of a sweep; it runs every combination, with the same seeds in each.

    Every setting of `TrialConfig` is a keyword; it takes one value or several. Noise levels are numbers, or pairs of mm
    and degrees; `noise_mm` and `noise_deg` may be given in their place. Settings that do not affect a method, such as
    the noise of `oracle`, are recorded for it as their defaults, and such a trial runs once.
    """

    scenario: tuple[str, ...]
    """Names, or paths of scenario files."""
    clearance_mm: tuple[float, ...] = field(default=(), kw_only=True)
    """Default: the clearance of each scenario."""
    noise: tuple[str, ...] = field(default=(), kw_only=True)
    """Default: `isotropic`; none with the pose source `depth-camera` alone."""
    noise_mm: tuple[float, ...] = field(default=(), kw_only=True)
    noise_deg: tuple[float, ...] = field(default=(), kw_only=True)
    trials: int = field(default=100, kw_only=True)
    """Trials of each combination."""
    seed: int = field(default=0, kw_only=True)
    """The first of the seeds."""

    def __post_init__(self) -> None:
        if self.noise_mm != () or self.noise_deg != ():
            by_axis = [_several(values) or (1.0,) for values in (self.noise_mm, self.noise_deg)]
            object.__setattr__(self, "noise_level", tuple(product(*by_axis)))
            object.__setattr__(self, "noise_mm", ())
            object.__setattr__(self, "noise_deg", ())
        for info in AXES:
            given = _several(getattr(self, info.name))
            entries = given if info.is_whole else tuple(map(_plain, given))
            values = tuple(dict.fromkeys(map(info.spelled, entries) if info.spelled else entries))
            require(
                values or info.name in _MAY_BE_EMPTY,
                f"no {info.words} was given for the sweep; at least one is needed.",
            )
            object.__setattr__(self, info.name, values)
        require(
            isinstance(self.trials, Integral) and 1 <= self.trials <= MOST_TRIALS,
            f"{self.trials} trials were given; a whole number from 1 to {MOST_TRIALS} is allowed.",
        )
        object.__setattr__(self, "trials", int(self.trials))
        check("seed", self.seed)
        check("seed", self.seed + self.trials - 1)
        for source in self.pose_source:
            check("pose_source", source)
        drawn = set(self.pose_source) != {DEPTH_CAMERA}
        if self.noise and not drawn:
            refuse_noise(*self.noise)
        object.__setattr__(self, "noise", self.noise or (TrialConfig.noise,) * drawn)
        for level, source in product(self.noise_level, self.pose_source):
            if isinstance(level, tuple):
                noise_pair(level, source)
            else:
                check("noise_mm", level, source, "noise level")
        for name, values in (
            {name: getattr(self, name) for name, info in SETTINGS.items() if info.axis}
            | {name: (getattr(self, name),) for name in SHARED}
        ).items():
            for value in values:
                check(name, value)
                if SETTINGS[name].is_text:
                    require_text(SETTINGS[name].words, value)
                require(
                    not SETTINGS[name].is_text or name == "scenario" or not UNSHOWN.search(value),
                    f"the name {value!r} was given, which has control characters or half letters; use another one.",
                )
        check_together(self.fidelity, *self.grasp)
        check_grip(any(map(probes, self.method)), *self.grasp)


def _several(values: Any) -> tuple[Any, ...]:
    """One value or several as a tuple: a text is one name."""
    return tuple(values) if isinstance(values, Iterable) and not isinstance(values, str) else (values,)


def check_grids(grids: Sequence[SweepConfig]) -> None:
    """Raise an `InputError` unless there is a grid, all have the same arm, time step and fidelity, and they are not
    larger than can be held."""
    require(grids, "no grid was given for the sweep; at least one is needed.")
    for name in SHARED:
        values = {getattr(grid, name): None for grid in grids}
        require(len(values) <= 1, f"{name} of a sweep is {' and '.join(map(str, values))}; run a sweep for each.")
    most = sum(grid.trials * math.prod(max(1, len(getattr(grid, info.name))) for info in AXES) for grid in grids)
    require(
        most <= MOST_TRIALS,
        f"the sweep has up to {most:,} trials, and at most {MOST_TRIALS:,} are allowed in one folder; share them "
        "out over several: other seeds, or other scenarios, in each.",
    )


def load_all(grids: Sequence[SweepConfig]) -> Mapping[str, Scenario]:
    """Every scenario of a sweep by what was given for it.

    Raises:
        InputError: A scenario cannot be loaded, or two have the same name.
    """
    loaded = {source: load_scenario(source) for grid in grids for source in grid.scenario}
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


def units(
    grids: Sequence[SweepConfig], loaded: Mapping[str, Scenario], secret_seed: SecretSeed | None = None
) -> Iterator[Batch]:
    """All trials of a sweep, each once, ordered by seed, so that every condition of an interrupted sweep has about as
    many.

    Noise and human error do not affect the oracle: it runs once per seed, grasp and robot error, recorded with noise
    level 0, human error scale 0 and the first noise model or pose source. Methods without a corrector are recorded with
    the contact source `given`, those that do not reobserve with 0 reobservations, those without `+probe` with the
    default sensor and assumed robot error.
    """
    for seed in sorted({seed for grid in grids for seed in range(grid.seed, grid.seed + grid.trials)}):
        those = [grid for grid in grids if grid.seed <= seed < grid.seed + grid.trials]
        for source, scenario in loaded.items():
            yield from _units(those, source, scenario, seed, secret_seed)


def described(grids: Sequence[SweepConfig], loaded: Mapping[str, Scenario]) -> list[dict[str, Any]]:
    """The grids as they stand in `run.json`, with scenarios by name and clearances filled in."""
    forms = []
    for grid in grids:
        values = {key: list(value) if isinstance(value, tuple) else value for key, value in asdict(grid).items()}
        own = {loaded[source].name: loaded[source].clearance_mm for source in grid.scenario}
        clearances = {name: list(grid.clearance_mm or (clearance,)) for name, clearance in own.items()}
        forms.append({**values, "scenario": list(own), "clearance_mm": clearances})
    return forms


def _units(
    grids: Sequence[SweepConfig], source: str, scenario: Scenario, seed: int, secret_seed: SecretSeed | None
) -> Iterator[Batch]:
    """The trials of a scenario and a seed, by what they share."""
    together = grouped(
        ((clearance, trial.human_error_scale, trial.pose_source), trial)
        for grid in grids
        if source in grid.scenario
        for clearance in grid.clearance_mm or (scenario.clearance_mm,)
        for trial in _trials(grid, source, clearance, seed, secret_seed)
    )
    return (tuple(dict.fromkeys(trials)) for trials in together.values())


def _trials(
    grid: SweepConfig, source: str, clearance_mm: float, seed: int, secret_seed: SecretSeed | None
) -> Iterator[TrialConfig]:
    """Every combination of a grid as what its method meets of it; some are the same."""
    same: dict[str, Any] = {name: getattr(grid, name) for name in SHARED}
    same |= {"scenario": source, "clearance_mm": clearance_mm, "seed": seed, "secret_seed": secret_seed}
    values = [getattr(grid, info.name) or (DEPTH_CAMERA,) for info in _VARIED]
    for combination in product(*values):
        asked = dict(zip((info.name for info in _VARIED), combination, strict=True))
        yield TrialConfig(**same, **_met(asked, grid))


def _met(asked: dict[str, Any], grid: SweepConfig) -> dict[str, Any]:
    """The settings that affect a method, with defaults in place of the others."""
    method = asked["method"]
    if knows_truth(method):
        asked |= {
            "noise_level": 0.0,
            "human_error_scale": 0.0,
            "pose_source": grid.pose_source[0],
            "noise": grid.noise[0] if grid.noise else DEPTH_CAMERA,
        }
    if asked["pose_source"] == DEPTH_CAMERA:
        asked["noise"] = DEPTH_CAMERA
    for name, is_met in _MET_BY_SOME.items():
        if not is_met(method):
            asked[name] = SETTINGS[name].default
    asked["noise_mm"], asked["noise_deg"] = noise_pair(asked.pop("noise_level"), asked["pose_source"])
    return asked


def _plain(value: Any) -> Any:
    """Numbers as records have them, whatever their type: 2.0 for 2, and 0.0 for -0.0."""
    if isinstance(value, Real) and not isinstance(value, bool):
        return float(value) + 0.0
    if isinstance(value, Sequence) and not isinstance(value, str):
        return tuple(map(_plain, value))
    return value
