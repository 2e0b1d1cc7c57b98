"""Test the success rate of a method with as few trials as possible.

Wald's sequential probability ratio test (A. Wald, Sequential Tests of Statistical Hypotheses, Annals of Mathematical
Statistics 16, 1945) compares two rates after each trial: the required one, and the largest one to reject. It ends when
the likelihood of one is (1 - error) / error times that of the other.
"""

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from itertools import count
from pathlib import Path
from typing import Any, final

from apo_bench.arguments import check_arguments
from apo_bench.assembly import Correction, Observation
from apo_bench.benchmark.scoring.track import read_track
from apo_bench.benchmark.sweeps.grid import SweepConfig, list_work_units, load_all
from apo_bench.errors import require
from apo_bench.io import format_count
from apo_bench.records import CORRECTOR, TrialConfig
from apo_bench.simulation.scene import Scene
from apo_bench.trial.fingerprint import compute_content_hash
from apo_bench.trial.keywords import configure_trial
from apo_bench.trial.run import record_trial
from apo_bench.trial.trial_stages import demonstration_of, scene_key, scene_of

_MOST = 100_000
"""Most trials that a test may take; with the usual error it takes some dozens."""


@final
@dataclass(frozen=True)
class Decision:
    """The result of a sequential test."""

    passed: bool
    successes: int
    trials: int
    sentence: str


def sequential_test(
    outcomes: Iterator[bool], at_least: float, margin: float, error: float = 0.01, most: int = _MOST
) -> Decision:
    """Decide whether a success rate is high enough, with as few outcomes as possible.

    Args:
        outcomes: Independent successes and failures, of which only as many are taken as needed.
        at_least: If the rate is at least this, the test passes, except with probability `error`.
        margin: If the rate is lower by at least this, the test fails, except with probability `error`. In between,
        either
            result is possible.
        most: Number of outcomes after which the likelier of the two rates decides, as at the end of `outcomes`; the
        sentence
            states this.

    Raises:
        InputError: A number is not allowed, or there is no outcome.
    """
    require(
        1e-6 <= margin < at_least <= 1.0,
        f"at_least={at_least:g} and margin={margin:g} were given; 1e-6 <= margin < at_least <= 1 is allowed.",
    )
    require(1e-9 <= error < 0.5, f"error={error:g} was given; a number from 1e-9 and below 0.5 is allowed.")
    require(most >= 1, f"most={most!r} was given; a whole number from 1 is allowed.")
    low = at_least - margin
    success = math.log(at_least / low)  # log likelihood ratio of one success
    # log likelihood ratio of one failure
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
    verdict = f"it is at least {at_least:g}" if passed else f"it is below {at_least:g}"
    undecided = f", though it is not decided after {trials}" * (abs(evidence) < bound)  # the likelier rate decided
    return Decision(
        passed, successes, trials, f"{successes} of {format_count(trials, 'trial')} succeeded: {verdict}{undecided}"
    )


@check_arguments
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
    """Raise an `AssertionError` unless a method succeeds often enough.

    Args:
        method: A method by name, or a corrector.
        trials: A track, by name or file, whose conditions are tried in turn; or the settings of one condition.
        at_least, margin, error, most: As in `sequential_test`.
        seed: The first seed; every trial has the next one, so that trials are independent.

    Raises:
        InputError: A method, track or number is not allowed.
    """
    name = method if isinstance(method, str) else CORRECTOR
    corrector = None if isinstance(method, str) else method
    failures: list[str] = []
    outcomes = _outcomes(_conditions(trials, name), seed, corrector, failures)
    decision = sequential_test(outcomes, at_least, margin, error, most)
    if not decision.passed:
        called = name if corrector is None else getattr(corrector, "__name__", type(corrector).__name__)
        last = f"; the last failure: {failures[-1]}" if failures else ""
        raise AssertionError(f"{called}, {decision.sentence}{last}.")
    return decision


def _conditions(trials: Any, method: str) -> list[TrialConfig]:
    """Return one trial of every condition."""
    if isinstance(trials, Mapping):
        given = dict(trials)
        require("scenario" in given and "seed" not in given, "the settings need a scenario, and no seed; change them.")
        trials, _ = configure_trial(given.pop("scenario"), **given)
    if isinstance(trials, TrialConfig):
        return [replace(trials, method=method)]
    track = read_track(trials)
    grids: list[SweepConfig] = [replace(grid, trials=1) for arm in track.arms for grid in track.of(method, arm)]
    return [trial for grid in grids for unit in list_work_units([grid], load_all([grid])) for trial in unit]


def _outcomes(configs: list[TrialConfig], seed: int, corrector: Any, failures: list[str]) -> Iterator[bool]:
    """Yield the success of each trial that counts, conditions in turn, every trial with its own seed."""
    scenes: dict[Any, tuple[Scene, str]] = {}
    for i in count():
        config = replace(configs[i % len(configs)], seed=seed + i)
        key = scene_key(config)
        if key not in scenes:
            scene = scene_of(config)
            scenes[key] = scene, compute_content_hash(scene.scenario, config.scenario, scene.arm.files)
        scene, content = scenes[key]
        record = record_trial(config, scene, demonstration_of(config, scene), content, method=corrector)
        if record["success"] is not None:
            failures += [str(record["sentence"])] * (not record["success"])
            yield record["success"]
