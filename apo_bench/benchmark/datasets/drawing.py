"""Pairs of observation and truth, drawn without physics from streams of chance that no trial uses.

Many demonstrations, seen by one call of a noise model: as one long demonstration whose parts are all different.
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
from apo_bench.perception.observation.observing import observe
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
"""Models whose errors of operations on different parts are independent, whatever else is seen."""


@final
class Seen(NamedTuple):
    """What was seen of many demonstrations."""

    poses: Array
    """(n, k, 4, 4)."""
    covariance: Array
    """(n, k, 6, 6)."""
    seen: NDArray[np.bool_]
    """(n, k)."""


def by_part(noise: Noise) -> bool:
    """Whether a noise model draws many demonstrations at once; others draw one after the other."""
    return type(noise) in _BY_PART or (isinstance(noise, CameraFailures) and noise.by_part)


def observe_many(
    assembly: Assembly, shown: Layouts, human_error: Array, noise: Noise, rng: np.random.Generator
) -> Seen:
    """What a noise model makes of many demonstrations of one assembly.

    Args:
        shown: Where every part was put.
        human_error: (k, 6, 6), covariance as in a `Demonstration`.
    """
    n, k = shown.poses.shape[:2]
    if by_part(noise):
        start = {_copy(part, i): T for part, poses in shown.start.items() for i, T in enumerate(poses)}
        long = Demonstration(
            _repeated(assembly, n), start, shown.poses.reshape(-1, 4, 4), {}, np.tile(human_error, (n, 1, 1))
        )
        return _stacked([noise(long.assembly, long, rng)], n, k)
    each = []
    for i, goals in enumerate(shown.poses):
        one = Demonstration(assembly, {part: poses[i] for part, poses in shown.start.items()}, goals, {}, human_error)
        each.append(observe(one, noise, rng))
    return _stacked(each, n, k)


def _stacked(observations: list[Observation], n: int, k: int) -> Seen:
    return Seen(
        np.concatenate([seen.poses for seen in observations]).reshape(n, k, 4, 4),
        np.concatenate([seen.covariance for seen in observations]).reshape(n, k, 6, 6),
        np.concatenate([seen.observed for seen in observations]).reshape(n, k),
    )


def _copy(part: str, i: int) -> str:
    return f"{part}/{i}"


@lru_cache(maxsize=32)
def _repeated(assembly: Assembly, n: int) -> Assembly:
    """The same operations n times, each time with parts of their own, and without contacts, which no camera sees."""
    return Assembly(
        {_copy(part, i): solid for part, solid in assembly.solids.items() for i in range(n)},
        tuple(
            Operation(_copy(each.main, i), carries=tuple(_copy(part, i) for part in each.carries))
            for i in range(n)
            for each in assembly.operations
        ),
        frozenset(_copy(part, i) for part in assembly.fixed for i in range(n)),
    )


BLOCK = 128
"""So many pairs of a scenario are drawn at once, whatever is asked for: more of them begin with the same ones."""
_MOST = 10_000_000
STREAM = 0x70616972
"""What tells these streams of chance from others of the same seed; trials have none with a spawn key."""

Given = str | Path | Scenario


@final
@dataclass(frozen=True, eq=False)
class Pairs:
    """n pairs of at most k operations: what was seen, and where everything really goes.

    A data set with a length and an index, as `torch.utils.data.DataLoader` takes it: `pairs[i]` has the entries of pair
    i, `pairs[i:j]` those of several, as arrays of their own. Beyond the last operation of a pair there are identities,
    and `seen` is False.
    """

    poses: Array
    """(n, k, 4, 4): seen, world frame, [m]."""
    covariance: Array
    """(n, k, 6, 6): stated, of the body twist by which each goal is wrong, [m, rad]."""
    seen: NDArray[np.bool_]
    """(n, k): whether the operation was seen at all."""
    truth: Array
    """(n, k, 4, 4): goals at which every contact holds, world frame, [m]."""
    operations: NDArray[np.int64]
    """(n,): how many operations a pair has."""
    scenario: NDArray[np.int64]
    """(n,): which of `scenarios` it is of."""
    scenarios: tuple[str, ...]
    together: bool
    """Whether the noise was drawn for many pairs at once; if not, for one after the other, which takes longer."""

    def __len__(self) -> int:
        return len(self.truth)

    def __getitem__(self, which: Any) -> dict[str, Any]:
        return {name: np.array(getattr(self, name)[which]) for name in _ARRAYS}


_ARRAYS = tuple(field.name for field in fields(Pairs))[:6]


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
    """Pairs of observation and truth; of several scenarios in turn.

    No physics: a part is shown exactly where the hand puts it, with the human error. The pairs are those that
    `draw_endless_pairs` begins with, so more of them begin with the same ones.

    Args:
        scenarios: Names, files or objects, one or several.
        noise: As in `make_noise`.
        n: How many.
        seed: From 0. No layout and no error of it is one of a trial of a sweep or a track.
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
    """Pairs without end, `BLOCK` of each scenario at a time, in turn; arguments are those of `draw_pairs`."""
    several: Any = scenarios if isinstance(scenarios, Iterable) and not isinstance(scenarios, str) else [scenarios]
    given = [*several]
    require(given, "no scenario was given; give one or more.")
    check("seed", seed)
    check("human_error_scale", human_error_scale)
    model = make_noise(noise, NoiseLevel(*parse_noise_level(noise_level)))
    loaded = [load_scenario(each) for each in given]
    return (_block(loaded, model, seed, number, human_error_scale) for number in count())


def _block(scenarios: Sequence[Scenario], noise: Noise, seed: int, number: int, human_error_scale: float) -> Pairs:
    m = len(scenarios)
    n = m * BLOCK
    k = max(len(scenario.assembly) for scenario in scenarios)
    goals, truth = np.tile(np.eye(4), (2, n, k, 1, 1))
    covariance = np.tile(np.eye(6), (n, k, 1, 1))
    there = np.zeros((n, k), dtype=np.bool_)
    for i, scenario in enumerate(scenarios):
        rng = seed_block(seed, scenario.name, number)
        layouts = draw_layouts(scenario, rng, BLOCK)
        shown = Layouts(layouts.poses @ _mistakes(scenario, human_error_scale, rng), layouts.start)
        seen = observe_many(
            scenario.assembly, shown, compute_human_error_covariance(scenario, human_error_scale), noise, rng
        )
        rows = slice(i, None, m), slice(len(scenario.assembly))
        truth[rows] = layouts.poses
        goals[rows], covariance[rows], there[rows] = seen
    sizes = np.array([len(scenario.assembly) for scenario in scenarios])
    turn = np.tile(np.arange(m), BLOCK)
    names = tuple(scenario.name for scenario in scenarios)
    return Pairs(goals, covariance, there, truth, sizes[turn], turn, names, by_part(noise))


def seed_block(seed: int, scenario: str, number: int) -> np.random.Generator:
    """The random numbers of one block of a scenario of this name."""
    return np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(STREAM, crc32(scenario.encode()), number)))


def _mistakes(scenario: Scenario, human_error_scale: float, rng: np.random.Generator) -> Array:
    """The human error of every pose, (BLOCK, k, 4, 4): as in a demonstration, in each of the layouts."""
    twists = np.zeros((BLOCK, len(scenario.assembly), 6))
    if (how := scenario.human_error) is not None:
        # how an error spreads is the same in every layout, and in proportion to it
        way = spread_error(scenario, Layout(scenario.nominal_poses, scenario.start), how.axis).offsets
        size = human_error_scale * rng.choice([-1.0, 1.0], BLOCK) * rng.uniform(how.low_m, how.high_m, BLOCK)
        twists[..., :3] = size[:, None, None] * way
    return pose.exp(twists)
