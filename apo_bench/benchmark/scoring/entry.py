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

from apo_bench.benchmark.analysis import (
    Interval,
    MeanEstimate,
    measure_mean_difference,
    measure_mean_rate,
    pool_estimates,
)
from apo_bench.errors import InputError, require
from apo_bench.geometry import Array
from apo_bench.io import UNSHOWN, read_bytes, write_file

SCHEMA: Final = "apo-bench/entry/1"
_LARGEST_BYTES = 4_000_000
RIGHT, WRONG, EXCLUDED = "10x"
"""Letters of trials in a condition: success, failure, or not counted since the demonstration failed."""
LONGEST_NAME = 200
LEAST_TRIALS = 10
"""Trials of a condition that a score needs."""
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
    """Upper end of the 95 % interval of the score."""
    trials: Count
    """Number of trials that count."""
    executed: Count
    """Number of those whose plan was executed."""
    predicted_success: Share | None
    """Mean predicted success of the plans; None without predictions."""
    brier: Share | None
    """Mean squared difference of predicted success and success over executed plans."""
    reliability: Share | None
    """Mean squared difference of predicted success and success rate in ten classes of predicted success."""
    records: Hash
    """Hash of the records, in any order."""
    code: Hash
    """Hash of the source files and package versions that made them."""
    secret_seed: Hash | None
    """Hash of the secret seed of the trials; None for trials that anyone can draw."""
    conditions: Annotated[Mapping[Text, Trials], Meta(max_length=1000)]
    """Settings of a condition -> its trials, one letter each, by their number."""

    def __post_init__(self) -> None:
        trials = "".join(self.conditions.values())
        counted = len(trials) - trials.count(EXCLUDED)
        require(
            self.trials == counted and trials.count(RIGHT) <= self.executed <= counted,
            f"{self.trials} trials, {self.executed} of them executed, are stated, and its conditions have {counted} "
            f"with {trials.count(RIGHT)} successes",
        )
        stated = (self.score, self.low, self.high)
        given = score_of(self.conditions)
        require(
            all(abs(a - b) < _TOLERANCE for a, b in zip(stated, given, strict=True)),
            "the score {:.6g} ({:.6g} to {:.6g}) is stated, and its conditions give {:.6g} ({:.6g} to {:.6g})".format(
                *stated, *given
            ),
        )
        require(
            self.brier is None or (self.predicted_success is not None and self.executed > 0),
            "a Brier score is stated, and no plan with a predicted success was executed",
        )
        require(
            (self.brier is None) == (self.reliability is None),
            "a Brier score and a reliability are stated together, or none of them is",
        )

    @property
    def when_executed(self) -> float | None:
        """Success rate of the executed plans, in percent; None without any."""
        right = sum(trials.count(RIGHT) for trials in self.conditions.values())
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
    versions: Annotated[Mapping[Name, Name], Meta(max_length=50)]
    """Versions of Python and of the packages that affect records."""
    revision: Annotated[str, Meta(pattern=r"^([0-9a-f]{7,64}(-dirty)?)?\Z")]
    """Git revision of the package; empty outside a checkout."""
    machine: Name
    tracks: Annotated[Mapping[Name, TrackScore], Meta(min_length=1, max_length=50)]
    real: bool = False
    """Whether the trials were made with a real robot and reported in a form."""

    def __post_init__(self) -> None:
        shown = (self.name, self.method, self.command, self.machine, *self.tracks)
        for text in (*shown, *self.versions, *self.versions.values()):
            require(not UNSHOWN.search(text), f"the text {text[:40]!r} has control characters or half letters")

    @property
    def has_few_trials(self) -> bool:
        """Whether a condition has fewer trials than a score needs."""
        return any(len(trials) < LEAST_TRIALS for track in self.tracks.values() for trials in track.conditions.values())

    @property
    def overall(self) -> tuple[float, float, float] | None:
        """Mean score over the tracks that count, in percent, and the ends of its 95 % interval; None without any."""
        those = [
            MeanEstimate(track.score, Interval(track.low, track.high), 0.0)
            for track in self.tracks.values()
            if track.overall
        ]
        if not those:
            return None
        mean, (low, high), _ = pool_estimates(those)
        return mean, max(0.0, low), min(100.0, high)


def compare_entries(entry: Entry, reference: Entry) -> dict[str, MeanEstimate]:
    """Return track -> difference of two entries in percentage points, first minus second, over the trials of both.

    Tracks without a common trial are left out: another version, or another secret seed.
    """
    found = {}
    for name, ours in entry.tracks.items():
        theirs = reference.tracks.get(name)
        if theirs is None or (ours.track, ours.secret_seed) != (theirs.track, theirs.secret_seed):
            continue
        apart = measure_mean_difference(
            [
                _subtract(trials, theirs.conditions[condition])
                for condition, trials in ours.conditions.items()
                if condition in theirs.conditions
            ]
        )
        if apart is not None:
            low, high = apart.interval
            found[name] = MeanEstimate(
                100.0 * apart.value, Interval(100.0 * low, 100.0 * high), 1e4 * apart.null_variance
            )
    return found


def _subtract(first: str, second: str) -> Array:
    """Return the first result minus the second one of the trials that count in both, (n,): 1, 0 or -1."""
    pairs = [(a, b) for a, b in zip(first, second, strict=False) if EXCLUDED not in (a, b)]
    return np.array([float(a == RIGHT) - float(b == RIGHT) for a, b in pairs])


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


def score_of(conditions: Mapping[str, str]) -> tuple[float, float, float]:
    """Return the mean over conditions of the success rate, in percent, and the ends of its 95 % interval.

    Conditions in which no trial counts are left out; without any other the result is 0, 0, 100.

    Args:
        conditions: Settings of a condition -> its trials, one letter each. All trials are independent.
    """
    known = [trials.replace(EXCLUDED, "") for trials in conditions.values()]
    found = measure_mean_rate([np.array([float(letter == RIGHT) for letter in trials]) for trials in known])
    return 100.0 * found.value, 100.0 * found.interval.low, 100.0 * found.interval.high


def form_of(entry: Entry) -> dict[str, Any]:
    """Return an entry without its single trials, for `--json`."""
    form: dict[str, Any] = msgspec.to_builtins(entry)
    for track in form["tracks"].values():
        del track["conditions"]
    return form
