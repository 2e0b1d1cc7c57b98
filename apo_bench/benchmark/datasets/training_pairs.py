"""Draw pairs of observation and truth without physics, from random streams that no trial uses.

Noise models that allow it observe many demonstrations in one call, as one long demonstration of different parts.
"""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, fields
from functools import lru_cache
from itertools import count
from pathlib import Path
from typing import Any, NamedTuple, final
from zlib import crc32

import numpy as np
from numpy.typing import NDArray

from apo_bench.arguments import check_arguments
from apo_bench.assembly import Assembly, Demonstration, Layout, Observation, Operation
from apo_bench.errors import require
from apo_bench.geometry import Array, pose
from apo_bench.perception.observation.models import (
    AnisotropicNoise,
    AnyTurnNoise,
    BiasNoise,
    CameraFailures,
    CameraNoise,
    EmpiricalNoise,
    FittedNoise,
    HeavyTailedNoise,
    IsotropicNoise,
    OutlierNoise,
    PerPartNoise,
    SymmetricNoise,
)
from apo_bench.perception.observation.noise import Noise, NoiseLevel, make_noise
from apo_bench.perception.observation.observe import observe
from apo_bench.records import USUAL, TrialConfig, check, parse_noise_level
from apo_bench.scenario import Scenario, compute_human_error_covariance, load_scenario, spread_error
from apo_bench.scenario.layout import Layouts, draw_layouts

_BY_PART = frozenset(
    (
        *(
            IsotropicNoise,
            AnisotropicNoise,
            PerPartNoise,
            CameraNoise,
            HeavyTailedNoise,
            OutlierNoise,
            BiasNoise,
            SymmetricNoise,
            AnyTurnNoise,
        ),
        *(EmpiricalNoise, FittedNoise),
    )
)
"""Noise models whose errors of operations on different parts are independent of each other."""


@final
class ObservedBatch(NamedTuple):
    """The observations of n demonstrations with k operations each."""

    poses: Array
    """(n, k, 4, 4), observed poses."""
    covariance: Array
    """(n, k, 6, 6), stated covariances."""
    observed: NDArray[np.bool_]
    """(n, k), whether the operation was observed."""


def observes_by_part(noise: Noise) -> bool:
    """Return whether a noise model can observe many demonstrations in one call."""
    return type(noise) in _BY_PART or (isinstance(noise, CameraFailures) and noise.by_part)


def observe_many(
    assembly: Assembly, shown: Layouts, human_error: Array, noise: Noise, rng: np.random.Generator
) -> ObservedBatch:
    """Observe many demonstrations of one assembly by a noise model.

    Args:
        shown: Poses at which the human placed the parts, in n layouts.
        human_error: Covariance as in a `Demonstration`, (k, 6, 6).
    """
    n, k = shown.poses.shape[:2]
    if observes_by_part(noise):
        start = {_name_copy(part, i): T for part, poses in shown.start.items() for i, T in enumerate(poses)}
        long = Demonstration(  # all demonstrations in a row; each has its own copies of the parts
            _repeat_assembly(assembly, n), start, shown.poses.reshape(-1, 4, 4), {}, np.tile(human_error, (n, 1, 1))
        )
        return _stack_observations([noise(long.assembly, long, rng)], n, k)
    each = []
    for i, goals in enumerate(shown.poses):
        one = Demonstration(assembly, {part: poses[i] for part, poses in shown.start.items()}, goals, {}, human_error)
        each.append(observe(one, noise, rng))
    return _stack_observations(each, n, k)


def _stack_observations(observations: list[Observation], n: int, k: int) -> ObservedBatch:
    """Join observations into arrays of n demonstrations with k operations."""
    return ObservedBatch(
        np.concatenate([seen.poses for seen in observations]).reshape(n, k, 4, 4),
        np.concatenate([seen.covariance for seen in observations]).reshape(n, k, 6, 6),
        np.concatenate([seen.observed for seen in observations]).reshape(n, k),
    )


def _name_copy(part: str, i: int) -> str:
    """Return the name of the copy of a part in demonstration i."""
    return f"{part}/{i}"


@lru_cache(maxsize=32)
def _repeat_assembly(assembly: Assembly, n: int) -> Assembly:
    """Return n copies of the operations, each with parts of its own, and without contacts, which no camera observes."""
    return Assembly(
        {_name_copy(part, i): solid for part, solid in assembly.solids.items() for i in range(n)},
        tuple(
            Operation(_name_copy(each.main, i), carries=tuple(_name_copy(part, i) for part in each.carries))
            for i in range(n)
            for each in assembly.operations
        ),
        frozenset(_name_copy(part, i) for part in assembly.fixed for i in range(n)),
    )


BLOCK = 128
"""Number of pairs of a scenario drawn together, so that a larger data set begins with the same pairs."""
_MOST = 10_000_000  # pairs in one call of draw_pairs
STREAM = 0x70616972
"""Key that separates these random streams from others of the same seed; those of trials have no spawn key."""

Given = str | Path | Scenario  # a scenario by name, by file or as an object


@final
@dataclass(frozen=True, eq=False)
class Pairs:
    """n pairs of at most k operations: the observation, and the true target poses.

    A data set with length and index, as `torch.utils.data.DataLoader` takes it: `pairs[i]` has the entries of pair i,
    `pairs[i:j]` those of several, as new arrays. Beyond the last operation of a pair there are identities, and
    `observed` is False.
    """

    poses: Array
    """(n, k, 4, 4): observed poses, world, [m]."""
    covariance: Array
    """(n, k, 6, 6): stated covariance of the error of each pose as a body twist, [m, rad]."""
    observed: NDArray[np.bool_]
    """(n, k): whether the operation was observed."""
    truth: Array
    """(n, k, 4, 4): poses at which every contact holds, world, [m]."""
    operations: NDArray[np.int64]
    """(n,): number of operations of each pair."""
    scenario: NDArray[np.int64]
    """(n,): index of its scenario in `scenarios`."""
    scenarios: tuple[str, ...]
    together: bool
    """Whether the noise was drawn for many pairs at once; if not, pair by pair, which takes longer."""

    def __len__(self) -> int:
        return len(self.truth)

    def __getitem__(self, which: Any) -> dict[str, Any]:
        return {name: np.array(getattr(self, name)[which]) for name in _ARRAYS}


_ARRAYS = tuple(field.name for field in fields(Pairs))[:6]  # the fields that are arrays


@check_arguments
def draw_pairs(
    scenarios: Given | Sequence[Given],
    noise: Any = USUAL,
    n: int = 1000,
    seed: int = 0,
    *,
    noise_level: float | Sequence[float] = 1.0,
    human_error_scale: float = TrialConfig.human_error_scale,
) -> Pairs:
    """Draw pairs of observation and truth, of several scenarios in turn.

    There is no physics: each part is placed exactly where the hand puts it, with the human error. The pairs are the
    first ones of `draw_endless_pairs`, so a larger n begins with the same pairs.

    Args:
        scenarios: Names, files or objects, one or several.
        noise: Noise model, as in `make_noise`.
        n: Number of pairs.
        seed: From 0. Whatever the seed, no pair shares its layout or its errors with a trial of a sweep or a track.
        noise_level: Standard deviation in mm and degrees, one number for both or a pair.
        human_error_scale: 0 for a human without error, 1 for the error that the scenario states.

    Raises:
        InputError: There is no such scenario or noise model, or a number is not allowed.
    """
    require(1 <= n <= _MOST, f"{n!r} pairs were asked for; give a whole number from 1 to {_MOST}.")
    blocks = list[Pairs]()
    for block in draw_endless_pairs(
        scenarios, noise, seed, noise_level=noise_level, human_error_scale=human_error_scale
    ):
        blocks.append(block)
        if sum(map(len, blocks)) >= n:
            break
    arrays = {name: np.concatenate([getattr(block, name) for block in blocks])[:n] for name in _ARRAYS}
    return Pairs(**arrays, scenarios=blocks[0].scenarios, together=blocks[0].together)


@check_arguments
def draw_endless_pairs(
    scenarios: Given | Sequence[Given],
    noise: Any = USUAL,
    seed: int = 0,
    *,
    noise_level: float | Sequence[float] = 1.0,
    human_error_scale: float = TrialConfig.human_error_scale,
) -> Iterator[Pairs]:
    """Draw pairs without end, `BLOCK` of each scenario at a time; arguments are those of `draw_pairs`."""
    several: Any = scenarios if isinstance(scenarios, Iterable) and not isinstance(scenarios, str) else [scenarios]
    given = [*several]
    require(given, "no scenario was given; give one or more.")
    check("seed", seed)
    check("human_error_scale", human_error_scale)
    model = make_noise(noise, NoiseLevel(*parse_noise_level(noise_level)))
    loaded = [load_scenario(each) for each in given]
    return (_draw_block(loaded, model, seed, number, human_error_scale) for number in count())


def _draw_block(scenarios: Sequence[Scenario], noise: Noise, seed: int, number: int, human_error_scale: float) -> Pairs:
    """Draw block `number`: `BLOCK` pairs of each of m scenarios, interleaved, so that pair i has scenario i mod
    m."""
    m = len(scenarios)
    n = m * BLOCK
    k = max(len(scenario.assembly) for scenario in scenarios)
    goals, truth = np.tile(np.eye(4), (2, n, k, 1, 1))
    covariance = np.tile(np.eye(6), (n, k, 1, 1))
    there = np.zeros((n, k), dtype=np.bool_)
    for i, scenario in enumerate(scenarios):
        rng = make_block_generator(seed, scenario.name, number)
        layouts = draw_layouts(scenario, rng, BLOCK)
        shown = Layouts(layouts.poses @ _draw_human_errors(scenario, human_error_scale, rng), layouts.start)
        seen = observe_many(
            scenario.assembly, shown, compute_human_error_covariance(scenario, human_error_scale), noise, rng
        )
        # every m-th pair, up to the last operation of the scenario
        rows = slice(i, None, m), slice(len(scenario.assembly))
        truth[rows] = layouts.poses
        goals[rows], covariance[rows], there[rows] = seen
    sizes = np.array([len(scenario.assembly) for scenario in scenarios])
    turn = np.tile(np.arange(m), BLOCK)  # scenario of each pair
    names = tuple(scenario.name for scenario in scenarios)
    return Pairs(goals, covariance, there, truth, sizes[turn], turn, names, observes_by_part(noise))


def make_block_generator(seed: int, scenario: str, number: int) -> np.random.Generator:
    """Return the random generator of one block of a scenario with this name."""
    return np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(STREAM, crc32(scenario.encode()), number)))


def _draw_human_errors(scenario: Scenario, human_error_scale: float, rng: np.random.Generator) -> Array:
    """Draw the human error of every pose in each of `BLOCK` layouts, (BLOCK, k, 4, 4), as in a demonstration."""
    twists = np.zeros((BLOCK, len(scenario.assembly), 6))
    if (how := scenario.human_error) is not None:
        # the error is proportional to its size, and its direction is the same in every layout
        way = spread_error(scenario, Layout(scenario.nominal_poses, scenario.start), how.axis).offsets
        # either direction, with a size that is uniform between the limits of the scenario
        size = human_error_scale * rng.choice([-1.0, 1.0], BLOCK) * rng.uniform(how.low_m, how.high_m, BLOCK)
        twists[..., :3] = size[:, None, None] * way
    return pose.exp(twists)
