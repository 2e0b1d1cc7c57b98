"""For tests of one's own code: does a method still succeed as often as it should? Asked with as few trials as it takes.

Wald's sequential probability ratio test (A. Wald, Sequential Tests of Statistical Hypotheses, Annals of Mathematical
Statistics 16, 1945): after each trial the likelihood of the rate that is asked is held against that of the least rate
that is refused, until one of them is (1 - error) / error times the other.
"""

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, fields, replace
from itertools import count
from pathlib import Path
from typing import Any, final

from apo_bench.assembly import Correction, Observation
from apo_bench.benchmark.scoring.track import read_track
from apo_bench.benchmark.sweeps.grid import SweepConfig, load_all, units
from apo_bench.errors import require, unknown
from apo_bench.records import CORRECTOR, TrialConfig
from apo_bench.simulation.scene import Scene
from apo_bench.trial.fingerprint import content_hash
from apo_bench.trial.run import record_trial
from apo_bench.trial.stages import demonstration_of, scene_key, scene_of

_MOST = 100_000
"""Trials that a test may take; with the usual error it takes some dozens."""


@final
@dataclass(frozen=True)
class Decision:
    """How a sequential test ended."""

    passed: bool
    successes: int
    trials: int
    sentence: str


def sequential_test(
    outcomes: Iterator[bool], at_least: float, margin: float, error: float = 0.01, most: int = _MOST
) -> Decision:
    """Whether a rate of successes is what is asked, out of as few outcomes as it takes.

    Args:
        outcomes: Successes and failures, independent of each other; one after the other is taken.
        at_least: With this rate or a higher one the test passes, but in `error` of all cases.
        margin: With a rate that is lower by this or more it fails, but in `error` of all cases. Between the two rates
            it may end either way.
        most: Outcomes after which the likelier of the two rates decides, as it does where outcomes end; the sentence
            says so.

    Raises:
        InputError: Numbers that are not allowed, or no outcome.
    """
    require(
        1e-6 <= margin < at_least <= 1.0,
        f"at_least={at_least:g} and margin={margin:g} were given; 1e-6 <= margin < at_least <= 1 is allowed.",
    )
    require(1e-9 <= error < 0.5, f"error={error:g} was given; a number from 1e-9 and below 0.5 is allowed.")
    require(most >= 1, f"most={most!r} was given; a whole number from 1 is allowed.")
    low = at_least - margin
    success = math.log(at_least / low)
    failure = math.log((1.0 - at_least) / (1.0 - low)) if at_least < 1.0 else -math.inf
    bound = math.log((1.0 - error) / error)
    successes = trials = 0
    evidence = 0.0
    for outcome in outcomes:
        trials += 1
        successes += bool(outcome)
        evidence += success if outcome else failure
        if abs(evidence) >= bound or trials >= most:
            break
    require(trials, "no outcome was given; at least one is needed.")
    passed = evidence > 0.0
    verdict = f"at least {at_least:g} is believed" if passed else f"it is below {at_least:g}"
    undecided = f", though it is not decided after {trials}" * (abs(evidence) < bound)
    return Decision(passed, successes, trials, f"{successes} of {trials} trials succeeded: {verdict}{undecided}")


def assert_success_rate(
    method: str | Callable[[Observation], Correction],
    trials: str | Path | TrialConfig | Mapping[str, Any],
    *,
    at_least: float,
    margin: float,
    error: float = 0.01,
    most: int = _MOST,
    seed: int = 0,
) -> Decision:
    """Raise an `AssertionError` unless a method succeeds as often as it should.

    Args:
        method: As for `run_trial`; or a corrector itself.
        trials: A track, by name or file, all of its cells in turn; or the settings of one cell.
        at_least, margin, error, most: As in `sequential_test`.
        seed: The first; every trial has the next one, so that trials are independent.

    Raises:
        InputError: A method, track or number that is not allowed.
    """
    require(isinstance(method, str) or callable(method), f"{method!r} was given as method; give a name or a corrector.")
    name = method if isinstance(method, str) else CORRECTOR
    cells = _cells(trials, name)
    said: list[str] = []
    corrector = None if isinstance(method, str) else method
    decision = sequential_test(_outcomes(cells, seed, corrector, said), at_least, margin, error, most)
    if not decision.passed:
        called = name if isinstance(method, str) else getattr(method, "__name__", type(method).__name__)
        raise AssertionError(f"{called}, {decision.sentence}{''.join(f'; the last failure: {x}' for x in said[-1:])}.")
    return decision


def _cells(trials: Any, method: str) -> list[TrialConfig]:
    """One trial of every cell."""
    if isinstance(trials, Mapping):
        allowed = [each.name for each in fields(TrialConfig) if each.name not in ("method", "seed")]
        for key in trials:
            require(key in allowed, unknown("setting", str(key), allowed))
        require("scenario" in trials, "the settings of a cell have no scenario; name one.")
        trials = TrialConfig(**trials)
    if isinstance(trials, TrialConfig):
        return [replace(trials, method=method)]
    require(
        isinstance(trials, str | Path),
        f"{trials!r} was given as trials; give a track, by name or file, or TrialConfig.",
    )
    track = read_track(trials)
    grids: list[SweepConfig] = [replace(grid, trials=1) for arm in track.arms for grid in track.of(method, arm)]
    return [trial for grid in grids for unit in units([grid], load_all([grid])) for trial in unit]


def _outcomes(cells: list[TrialConfig], seed: int, method: Any, said: list[str]) -> Iterator[bool]:
    """Success of each trial that counts, cells in turn, every trial with a seed of its own."""
    scenes: dict[Any, tuple[Scene, str]] = {}
    for i in count():
        settings = replace(cells[i % len(cells)], seed=seed + i)
        key = scene_key(settings)
        if key not in scenes:
            scene = scene_of(settings)
            scenes[key] = scene, content_hash(scene.scenario, settings.scenario, scene.arm.files)
        scene, content = scenes[key]
        row = record_trial(settings, scene, demonstration_of(settings, scene), content, method=method)
        if row["success"] is not None:
            said += [str(row["sentence"])] * (not row["success"])
            yield row["success"]
