"""Tracks: files with fixed scenarios, seeds and settings.

A track is a sweep file without methods, and a table of its own:

    [track]
    schema = "apo-bench/track/1"
    title = "Poses of a camera that errs by a millimetre or so"
    overall = true        # whether it counts in the score over all tracks
    arms = ["six_axis"]   # one sweep for each; without it, the usual arm

Every condition has other seeds, the same for every method.
"""

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any, Literal, final

from msgspec import Meta

from apo_bench.arguments import check_arguments
from apo_bench.benchmark.sweeps.grid import AXES, SweepConfig, draw_seed, list_conditions
from apo_bench.benchmark.sweeps.sweep_file import read_sweep
from apo_bench.errors import require, unknown
from apo_bench.io import FileTable, Text, convert_typed, read_bytes, read_plain
from apo_bench.records import TrialConfig
from apo_bench.resources import folder

TABLE = "track"
_HEX = 16
_NAMED = tuple(info.name for info in AXES if info.name not in ("scenario", "method"))
"""Settings that name a condition if they vary."""


@final
@dataclass(frozen=True)
class Track:
    """A fixed set of trials on which methods are scored."""

    name: str
    title: str
    overall: bool
    """Whether it counts in the overall score; the others are for regression tests."""
    arms: tuple[str, ...]
    hash: str
    """16 hexadecimal digits of a hash of the file."""
    grids: tuple[SweepConfig, ...]
    """The grids of the file; their methods are replaced by the one that is scored."""

    def of(self, method: str, arm: str, trials: int | None = None) -> tuple[SweepConfig, ...]:
        """Return the grids of a method on one of the arms, with at most so many trials per condition."""
        own: dict[str, Any] = {"method": (method,), "arm": arm, "seed": self.grids[0].seed + self.arms.index(arm)}
        if trials is not None:
            own["trials"] = min(trials, self.grids[0].trials)
        return tuple(replace(grid, **own) for grid in self.grids)

    def find_trials(self, arm: str, trials: int | None = None) -> dict[int, tuple[str, int]]:
        """Return seed -> the condition of a trial in words, and the number of the trial in it."""
        grids = self.of("oracle", arm, trials)
        conditions = list(list_conditions(grids))
        names = ["scenario", *(name for name in _NAMED if len({getattr(one, name) for one in conditions}) > 1)]
        words = [", ".join(_describe(one, name) for name in names) for one in conditions]
        prefix = f"{arm}: " if len(self.arms) > 1 else ""
        return {
            draw_seed(grids[0].seed, number, trial): (prefix + text, trial)
            for number, text in enumerate(words)
            for trial in range(grids[0].trials)
        }


def _describe(condition: SweepConfig, name: str) -> str:
    """Return a setting of a condition in words; the scenario is its name."""
    value = (*getattr(condition, name), "the scenario's")[0]
    text = f"{value:g}" if isinstance(value, float) else str(value)
    return text if name == "scenario" else f"{name} {text}"


class TrackTable(FileTable, frozen=True, kw_only=True):
    """The table `[track]` of a track file."""

    schema: Literal["apo-bench/track/1"]
    title: Text
    overall: bool = True
    # msgspec 0.22 frees the pattern of `Text` twice where it is one of several types, so one name is a plain `str`.
    arms: str | Annotated[tuple[Text, ...], Meta(min_length=1)] = TrialConfig.arm


def seen_by(track: Track, estimator: str) -> Track:
    """Return a track whose poses have the errors of an estimator; it does not count in the overall score.

    Args:
        estimator: A noise file, as `noise fit` writes it from estimates and ground truth.

    Raises:
        InputError: There is no such file.
    """
    content = read_bytes(estimator, "noise file (.toml)")
    own: dict[str, Any] = {"noise": (estimator,), "pose_source": (TrialConfig.pose_source,)}
    return replace(
        track,
        name=f"{track.name}-{Path(estimator).stem}",
        overall=False,
        hash=hashlib.sha256(track.hash.encode() + content).hexdigest()[:_HEX],
        grids=tuple(replace(grid, **own) for grid in track.grids),
    )


def track_names() -> tuple[str, ...]:
    """Return the names of the tracks that come with the package, in alphabetical order."""
    return tuple(sorted(path.stem for path in (folder("scenarios") / "tracks").glob("*.toml")))


@check_arguments
def read_track(given: str | Path) -> Track:
    """Read a track by name, or from a file.

    Raises:
        InputError: There is no such track, or its file is invalid.
    """
    text = str(given)
    if not text.endswith(".toml"):
        require(text in track_names(), unknown("track", text, track_names()) + " Or give a track file (.toml).")
        given = folder("scenarios") / "tracks" / f"{text}.toml"
    path = Path(given)
    top = read_plain(path, "track file")
    require(TABLE in top, f"{path}: a table [{TABLE}] is needed.")
    require("method" not in top, f"{path}, method: a track has no method, its entrants are; remove the key.")
    table = convert_typed(top[TABLE], TrackTable, f"{path}, {TABLE}")
    grids = read_sweep(path, {"independent_seeds": True}, besides=(TABLE,))
    for name in ("seed", "trials"):
        require(
            len({getattr(grid, name) for grid in grids}) == 1,
            f"{path}: all grids of a track have the same {name}; remove the key '{name}' below [[also]].",
        )
    return Track(
        name=path.stem,
        title=table.title,
        overall=table.overall,
        arms=(table.arms,) if isinstance(table.arms, str) else table.arms,
        hash=hashlib.sha256(read_bytes(path, "track file")).hexdigest()[:_HEX],
        grids=grids,
    )


@check_arguments
def read_tracks(names: Sequence[str]) -> tuple[Track, ...]:
    """Read tracks by name or file; without names, those of the package that count in the overall score.

    Raises:
        InputError: As `read_track`, or two tracks have the same name.
    """
    tracks = tuple(map(read_track, names or track_names()))
    tracks = tuple(track for track in tracks if names or track.overall)
    called = [track.name for track in tracks]
    for name in called:
        require(called.count(name) == 1, f"the track {name} was given twice; name every track once.")
    return tracks
