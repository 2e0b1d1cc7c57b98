"""An entry: what a method scored, in a file that another person's table can read. Schema `apo-bench/entry/1`."""

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, final

import msgspec

from apo_bench.errors import InputError, require
from apo_bench.geometry import Array
from apo_bench.io import read_bytes, write_file

SCHEMA = "apo-bench/entry/1"
_LARGEST_BYTES = 16_000_000
RIGHT, WRONG, EXCLUDED = "10x"
"""How a cell spells a trial: success, none, or one that does not count since the demonstration itself was not right."""


@final
@dataclass(frozen=True)
class TrackScore:
    """What a method scored in one track."""

    track: str
    """Hash of the track's file."""
    overall: bool
    """Whether it counts in the score over all."""
    score: float
    """Mean over cells of the success rate, in percent; a plan that is not carried out is no success."""
    low: float
    high: float
    """Of the 95 % interval over seeds, in percent."""
    trials: int
    """Those that count."""
    executed: int
    """Those whose plan was carried out."""
    promised: float | None
    """Mean of what plans promised; None where none did."""
    brier: float | None
    """Mean squared difference of promise and success, of plans that were carried out."""
    rows: str
    """16 hexadecimal digits over the rows, in any order."""
    code: str
    """The same over the source files and package versions they were made with."""
    salt: str | None
    """Hash of the secret that the trials were drawn with; None for trials that everybody can draw."""
    cells: Mapping[str, str]
    """Settings of a cell -> its trials, one character each, the first seed first."""

    @property
    def when_executed(self) -> float | None:
        """Success rate of the plans that were carried out, in percent; None without one."""
        right = sum(trials.count(RIGHT) for trials in self.cells.values())
        return 100.0 * right / self.executed if self.executed else None


@final
@dataclass(frozen=True)
class Entry:
    """What a method scored."""

    schema: str
    name: str
    """What the table calls it."""
    method: str
    """As rows spell it."""
    command: str
    """The command line that made it."""
    quick: bool
    """Whether it ran the few trials of `--quick`, which are no score."""
    versions: Mapping[str, str]
    """Of the packages that matter, and of Python."""
    machine: str
    tracks: Mapping[str, TrackScore]

    @property
    def overall(self) -> tuple[float, float, float] | None:
        """Mean over the tracks that count, in percent, and its 95 % interval, tracks taken for independent; None where
        there is none."""
        import numpy as np

        those = [track for track in self.tracks.values() if track.overall]
        if not those:
            return None
        scores: Array = np.array([[track.score, track.low, track.high] for track in those])
        mean = scores[:, 0].mean()
        below, above = (np.linalg.norm(scores[:, 0] - scores[:, i]) / len(those) for i in (1, 2))
        return float(mean), float(max(0.0, mean - below)), float(min(100.0, mean + above))


def write_entry(entry: Entry, path: str | Path) -> None:
    """Write an entry as JSON.

    Raises:
        InputError: The file cannot be written.
    """
    write_file(path, json.dumps(asdict(entry), indent=1, allow_nan=False) + "\n")


def read_entry(path: str | Path) -> Entry:
    """An entry out of a file.

    Raises:
        InputError: It cannot be read, or is something else.
    """
    try:
        entry = msgspec.json.decode(read_bytes(path, "entry", _LARGEST_BYTES), type=Entry)
    except msgspec.DecodeError as error:
        raise InputError(f"{path}: this is no entry of `apo-bench score` ({error}).") from error
    require(entry.schema == SCHEMA, f"{path}: the schema '{entry.schema}' was given; '{SCHEMA}' is needed.")
    for name, track in entry.tracks.items():
        _check(track, f"{path}, {name}")
    return entry


def _check(track: TrackScore, where: str) -> None:
    """Scores are what the trials say: a number by hand is refused."""
    counted = "".join(track.cells.values()).replace(EXCLUDED, "")
    require(
        set(counted) <= {RIGHT, WRONG} and track.trials == len(counted) and 0 <= track.executed <= track.trials,
        f"{where}: the trials of its cells are not those that it counts; make the entry anew.",
    )
    require(
        abs(track.score - mean_of(track.cells)) < 1e-6,
        f"{where}: the score {track.score:g} is not that of its trials, {mean_of(track.cells):g}; make the entry anew.",
    )
    shares = [x for x in (track.promised, track.brier) if x is not None]
    require(
        0.0 <= track.low <= track.score <= track.high <= 100.0 and all(0.0 <= x <= 1.0 for x in shares),
        f"{where}: an interval or a promise is none that trials can give; make the entry anew.",
    )


def mean_of(cells: Mapping[str, str]) -> float:
    """Mean over cells of the success rate, in percent; cells in which no trial counts are left out; 0 without any."""
    rates = [trials.count(RIGHT) / n for trials in cells.values() if (n := len(trials) - trials.count(EXCLUDED))]
    return 100.0 * sum(rates) / len(rates) if rates else 0.0


def form_of(entry: Entry) -> dict[str, Any]:
    """An entry without its single trials, for `--json`."""
    form = asdict(entry)
    for track in form["tracks"].values():
        del track["cells"]
    return form
