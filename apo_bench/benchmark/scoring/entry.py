"""Entries: the scores of a method in a file that other leaderboards can read. Schema `apo-bench/entry/1`.

An entry file may come from a stranger, so every text and number is bounded. Counts, scores and intervals must follow
from the trials that the entry lists.
"""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Final, Literal

import msgspec
import numpy as np
from msgspec import Meta

from apo_bench.benchmark.analysis import Results, pool_rate
from apo_bench.errors import InputError, require
from apo_bench.geometry import Array
from apo_bench.io import UNSHOWN, read_bytes, write_file

SCHEMA: Final = "apo-bench/entry/1"
_LARGEST_BYTES = 4_000_000
RIGHT, WRONG, EXCLUDED = "10x"
"""Letters of trials in a condition: success, failure, or not counted since the demonstration failed."""
LONGEST_NAME = 200
_TOLERANCE = 1e-6
"""Percentage points by which a score may differ, since processors round differently."""

Name = Annotated[str, Meta(min_length=1, max_length=LONGEST_NAME)]
Text = Annotated[str, Meta(max_length=4000)]
# a hash of 16 hexadecimal digits
Hash = Annotated[str, Meta(pattern=r"^[0-9a-f]{16}\Z")]
# the trials of a condition, one letter each
Trials = Annotated[str, Meta(pattern=rf"^[{RIGHT}{WRONG}{EXCLUDED}]+\Z")]
Count = Annotated[int, Meta(ge=0, le=1_000_000)]
Percent = Annotated[float, Meta(ge=0.0, le=100.0)]
Share = Annotated[float, Meta(ge=0.0, le=1.0)]


class TrackScore(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The score of a method in one track.

    Raises:
        InputError: Its numbers do not follow from its trials.
    """

    track: Hash
    """Hash of the track's file."""
    overall: bool
    """Whether the track counts in the overall score."""
    score: Percent
    """Mean over conditions of the success rate, in percent; a plan that is not executed is no success."""
    low: Percent  # lower end of the interval
    high: Percent
    """Upper end of the 95 % interval over seeds."""
    trials: Count
    """Number of trials that count."""
    executed: Count
    """Number of those whose plan was executed."""
    predicted_success: Share | None
    """Mean predicted success of the plans; None without predictions."""
    brier: Share | None
    """Mean squared difference of predicted success and success over executed plans."""
    rows: Hash
    """Hash of the records, in any order."""
    code: Hash
    """Hash of the source files and package versions that made them."""
    secret_seed: Hash | None
    """Hash of the secret seed of the trials; None for trials that anyone can draw."""
    cells: Mapping[Text, Trials]
    """Settings of a condition -> its trials, one letter each, by seed."""

    def __post_init__(self) -> None:
        trials = "".join(self.cells.values())
        counted = len(trials) - trials.count(EXCLUDED)
        require(
            self.trials == counted and trials.count(RIGHT) <= self.executed <= counted,
            f"{self.trials} trials, {self.executed} of them executed, are stated, and its cells have {counted} with "
            f"{trials.count(RIGHT)} successes",
        )
        stated = (self.score, self.low, self.high)
        given = score_of(self.cells)
        require(
            all(abs(a - b) < _TOLERANCE for a, b in zip(stated, given, strict=True)),
            "the score {:.6g} ({:.6g} to {:.6g}) is stated, and its cells give {:.6g} ({:.6g} to {:.6g})".format(
                *stated, *given
            ),
        )
        require(
            self.brier is None or (self.predicted_success is not None and self.executed > 0),
            "a Brier score is stated, and no plan with a predicted success was executed",
        )

    @property
    def when_executed(self) -> float | None:
        """Success rate of the executed plans, in percent; None without any."""
        right = sum(trials.count(RIGHT) for trials in self.cells.values())
        return 100.0 * right / self.executed if self.executed else None


class Entry(msgspec.Struct, frozen=True, forbid_unknown_fields=True, omit_defaults=True):
    """The scores of a method in one or several tracks.

    Raises:
        InputError: A text has characters that cannot be shown.
    """

    schema: Literal["apo-bench/entry/1"]
    name: Name
    """The name in tables."""
    method: Text
    """The method, as records spell it."""
    command: Text
    """The command line that made the entry."""
    quick: bool
    """Whether it ran the few trials of `--quick`, which are no score."""
    versions: Annotated[Mapping[Name, Name], Meta(max_length=50)]
    """Versions of Python and of the packages that affect records."""
    machine: Name
    tracks: Annotated[Mapping[Name, TrackScore], Meta(min_length=1, max_length=50)]
    real: bool = False
    """Whether the trials were made with a real robot and reported in a form."""

    def __post_init__(self) -> None:
        shown = (self.name, self.method, self.command, self.machine, *self.tracks)
        for text in (*shown, *self.versions, *self.versions.values()):
            require(not UNSHOWN.search(text), f"the text {text[:40]!r} has control characters or half letters")

    @property
    def overall(self) -> tuple[float, float, float] | None:
        """Mean score over the tracks that count, in percent, and the ends of its 95 % interval; None without any.

        The tracks are treated as independent: the half widths of their intervals add as squares.
        """
        those = [track for track in self.tracks.values() if track.overall]
        if not those:
            return None
        scores: Array = np.array([[track.score, track.low, track.high] for track in those])
        mean = scores[:, 0].mean()
        below, above = (np.linalg.norm(scores[:, 0] - scores[:, i]) / len(those) for i in (1, 2))
        return float(mean), float(max(0.0, mean - below)), float(min(100.0, mean + above))


def check_name(called: str, name: str) -> None:
    """Raise an `InputError` unless an entry can hold a name.

    Args:
        called: The kind of name, for the message: `entry`.
    """
    require(
        0 < len(name) <= LONGEST_NAME and not UNSHOWN.search(name),
        f"the name of the {called} must have 1 to {LONGEST_NAME} characters and no control characters, "
        f"{name[:40]!r} ({len(name)} characters) was given; choose another name.",
    )


def write_entry(entry: Entry, path: str | Path) -> None:
    """Write an entry as JSON.

    Raises:
        InputError: The file cannot be written.
    """
    write_file(path, json.dumps(msgspec.to_builtins(entry), indent=1, allow_nan=False) + "\n")


def read_entry(path: str | Path) -> Entry:
    """Read an entry from a file.

    Raises:
        InputError: The file cannot be read, or is no entry.
    """
    try:
        return msgspec.json.decode(read_bytes(path, "entry", _LARGEST_BYTES), type=Entry)
    except (msgspec.DecodeError, RecursionError, UnicodeError) as error:
        raise InputError(
            f"{path}: this is not an entry that `apo-bench score` writes ({error}); score the method again."
        ) from error


def score_of(cells: Mapping[str, str]) -> tuple[float, float, float]:
    """Return the mean over conditions of the success rate, in percent, and the ends of its 95 % interval over seeds.

    Conditions in which no trial counts are left out; without any other the result is 0, 0, 100. Trials at the same
    position have the same seed, since all grids of a track begin with the same seed.
    """
    rates = [trials.count(RIGHT) / n for trials in cells.values() if (n := len(trials) - trials.count(EXCLUDED))]
    if not rates:
        return 0.0, 0.0, 100.0
    score = 100.0 * sum(rates) / len(rates)
    # the position of a trial stands for its seed
    seeds = np.array([k for trials in cells.values() for k, letter in enumerate(trials) if letter != EXCLUDED])
    success = np.array([letter == RIGHT for trials in cells.values() for letter in trials if letter != EXCLUDED])
    results = Results(np.arange(len(seeds)), seeds, success.astype(float))
    low, high = pool_rate(results).interval
    # the interval of the pooled rate, widened to contain the mean over conditions
    return score, min(100.0 * low, score), max(100.0 * high, score)


def form_of(entry: Entry) -> dict[str, Any]:
    """Return an entry without its single trials, for `--json`."""
    form: dict[str, Any] = msgspec.to_builtins(entry)
    for track in form["tracks"].values():
        del track["cells"]
    return form
