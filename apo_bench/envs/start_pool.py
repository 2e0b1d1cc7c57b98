"""Which trial an episode of `APOInsert-v0` starts at: named, of the training pool, or for evaluation."""

from typing import NamedTuple

import numpy as np

from apo_bench.assembly import Outcome
from apo_bench.envs.episode_start import EpisodeStart, TrialStarts
from apo_bench.errors import InputError
from apo_bench.records import EVALUATION_STARTS, FIRST_TRAINING_TRIAL

MOST_TRIES = 100
"""Most replacements of a training trial that fails before the operation."""


class StartPool(NamedTuple):
    """The starts for training, which are kept after they were first prepared, and those for evaluation."""

    first: int
    """The first trial of the pool."""
    layouts: int
    """Number of starts in the pool."""
    kept: dict[int, EpisodeStart]
    """Number in the pool -> its start."""

    def draw(self, trials: TrialStarts, rng: np.random.Generator, usual: bool) -> EpisodeStart:
        """Return a random start of the training pool.

        Args:
            usual: Whether these are the trials of the pool; other ones are not kept.

        Raises:
            InputError: A trial of the pool and all its replacements fail before the operation.
        """
        number = int(rng.integers(self.layouts))
        if not usual:
            return self._prepare(trials, number)
        if number not in self.kept:
            self.kept[number] = self._prepare(trials, number)
        return self.kept[number]

    def _prepare(self, trials: TrialStarts, number: int) -> EpisodeStart:
        """Return one start of the pool."""
        begin = self.first + number
        step = max(EVALUATION_STARTS, self.layouts)  # no two starts of the pool have a replacement in common
        return _first_that_begins(trials, range(begin, begin + step * MOST_TRIES, step))


def draw_evaluation_trial(rng: np.random.Generator) -> int:
    """Return the number of a random trial for evaluation."""
    return int(rng.integers(EVALUATION_STARTS))


def begin_trial(trials: TrialStarts, number: int) -> EpisodeStart:
    """Return the start of a trial; a trial for evaluation has replacements, another one has none.

    Raises:
        InputError: It fails before the operation, as do its replacements.
    """
    last = FIRST_TRAINING_TRIAL if number < EVALUATION_STARTS else number + 1
    return _first_that_begins(trials, range(number, last, EVALUATION_STARTS))


def _first_that_begins(trials: TrialStarts, numbers: range) -> EpisodeStart:
    """Return the first of these trials that does not fail before the operation."""
    why = ""
    for number in numbers:
        begun = trials.begin(number)
        if not isinstance(begun, Outcome):
            return begun
        why = begun.sentence
    more = f", as do its {len(numbers) - 1} replacements" if len(numbers) > 1 else ""
    raise InputError(
        f"trial {numbers[0]} fails before this operation{more}: {why}; use another one, a lower noise level or a "
        "smaller robot error."
    )
