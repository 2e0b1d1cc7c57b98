"""The leaderboard: a page with a table of entries, their scores and intervals, and a figure."""

import warnings
from collections import Counter
from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np

from apo_bench.arguments import check_arguments
from apo_bench.benchmark.report.tables.table import Table, TableColumn
from apo_bench.benchmark.scoring.entry import Entry, TrackScore, read_entry
from apo_bench.benchmark.scoring.track import read_track, track_names
from apo_bench.errors import InputError, require
from apo_bench.io import check_target, group_by, save_figure, use_figure_style, write_file

_STATUS = (
    "A `self-reported` entry is unverified, since anyone can draw public seeds again. The author of this table ran "
    "`verified` entries with trials of a secret seed, whose hash was published before; entrants that are not trusted "
    "ran as programs, which get observations and nothing else. `real` entries are forms of trials with a real robot. "
    "`quick` entries ran a few trials, which are no score."
)
_RATES = (
    "Success rate in percent, mean over the conditions of a track, with its 95 % interval over seeds. In brackets: the "
    "rate of executed plans, where some were not executed."
)
_BRIER = "Brier score of the predicted success in each track: 0 is best, 0.25 is a coin."
_RUNS = "The file of each entry also has the hashes of tracks, code and records."
_MOST_SQUARES = 50
"""Most entries, and most tracks, in the figure; the tables have all."""
_LONGEST_LABEL = 30  # letters of a label of the figure


class Line(NamedTuple):
    """A line of the table: an entry with its place."""

    place: int
    entry: Entry
    verified: bool

    @property
    def status(self) -> str:
        status = "verified" if self.verified else "self-reported"
        return "real, " * self.entry.real + status + ", quick" * self.entry.quick


def ranked(entries: Sequence[Entry], secret_seeds: frozenset[str] = frozenset()) -> list[Line]:
    """Rank entries: by the number of tracks that count, then by overall score, then by name.

    Args:
        secret_seeds: Hashes of the secret seeds with which the author of the table drew trials.
    """
    count = {id(e): sum(track.overall for track in e.tracks.values()) for e in entries}
    order = sorted(entries, key=lambda e: (-count[id(e)], -(e.overall or (0.0,))[0], e.name))
    return [Line(i, entry, _is_verified(entry, secret_seeds)) for i, entry in enumerate(order, start=1)]


@check_arguments
def read_entries(folder: str | Path) -> tuple[list[Entry], list[str]]:
    """Read the entries of a folder (`*.json`).

    A file is left out if it is no entry, or if it has another version of a track than most entries.

    Returns:
        The entries, and a sentence for each file that was left out.

    Raises:
        InputError: No file is an entry.
    """
    found: dict[Path, Entry] = {}
    left_out: list[str] = []
    for path in sorted(Path(folder).glob("*.json")):
        try:
            found[path] = read_entry(path)
        except InputError as error:
            left_out.append(str(error))
    used = _used_versions(list(found.values()))
    entries: list[Entry] = []
    for path, entry in found.items():
        other = next((name for name, track in entry.tracks.items() if _version(track) != used[name]), None)
        if other is None:
            entries.append(entry)
        else:
            left_out.append(
                f"{path}: the entry is of another version of the track {other} ({entry.tracks[other].track}, not "
                f"{used[other][0]}); score the method again."
            )
    require(
        entries,
        left_out[0] if left_out else f"'{folder}' has no entry; give a folder of files that `score --out` wrote.",
    )
    return entries, left_out


def write_leaderboard(entries: Sequence[Entry], out: str | Path, secret_seeds: frozenset[str] = frozenset()) -> None:
    """Write the page, in Markdown, and its figure next to it.

    Args:
        entries: At least one, as `read_entries` returns them.

    Raises:
        InputError: The figure cannot be written.
    """
    tracks = _tracks(entries)
    lines = ranked(entries, secret_seeds)
    out = Path(out)
    picture = out.with_suffix(".png")
    check_target(out)
    _draw(lines[:_MOST_SQUARES], tracks[:_MOST_SQUARES], picture)
    write_file(out, "\n".join(_page(lines, tracks, picture.name)) + "\n")


def leaderboard_table(lines: Sequence[Line]) -> Table:
    """Return the main table: one line per entry, with its overall score."""
    return Table(
        lines,
        (
            TableColumn("place", "#"),
            TableColumn("name", "entry", "entry.name", words=True),
            TableColumn("score", "score", lambda line: _overall(line.entry)),
            TableColumn("tracks", "tracks", lambda line: sum(track.overall for track in line.entry.tracks.values())),
            TableColumn("status", "status", words=True),
        ),
    )


def _version(track: TrackScore) -> tuple[str, bool]:
    """Return what distinguishes versions of a track: its hash, and whether it counts in the overall score."""
    return track.track, track.overall


def _used_versions(entries: Sequence[Entry]) -> dict[str, tuple[str, bool]]:
    """Return the most frequent version of each track; in a tie that of the package, else the first."""
    stated = group_by((name, _version(track)) for entry in entries for name, track in entry.tracks.items())
    for name in set(stated) & set(track_names()):
        own = read_track(name)
        # False sorts first: the version of the package
        stated[name].sort(key=lambda version: version != (own.hash, own.overall))
    return {name: Counter(versions).most_common(1)[0][0] for name, versions in stated.items()}


def _tracks(entries: Sequence[Entry]) -> list[str]:
    """Return the names of all tracks, those that count first."""
    overall = {name: track.overall for entry in entries for name, track in entry.tracks.items()}
    return sorted(overall, key=lambda name: (not overall[name], name))


def _page(lines: Sequence[Line], tracks: Sequence[str], picture: str) -> Iterator[str]:
    """Yield the lines of the page in Markdown."""
    entry = TableColumn("name", "entry", "entry.name", words=True)
    rates = (entry, *(TableColumn(name, name, partial(_score_words, name)) for name in tracks))
    brier = (entry, *(TableColumn(name, name, partial(_brier, name)) for name in tracks))
    trials = TableColumn("trials", "trials", lambda line: sum(track.trials for track in line.entry.tracks.values()))
    runs = (entry, trials, TableColumn("command", "command", "entry.command", words=True))
    same = group_by((_machine_text(line.entry), line.entry.name) for line in lines)
    machine = TableColumn("machine", "versions and machine", lambda group: group[0], words=True)
    machines = (TableColumn("entries", "entries", lambda group: ", ".join(group[1]), words=True), machine)
    yield from ("# Leaderboard", "", f"{len(lines)} entries, the best first.", "")
    yield from leaderboard_table(lines).markdown()
    yield from ("", _STATUS, "", f"![Scores of entries in tracks]({picture})", "", "## Tracks", "", _RATES, "")
    yield from Table(lines, rates).markdown()
    yield from ("", "## Predicted success", "", _BRIER, "")
    yield from Table(lines, brier).markdown()
    yield from ("", "## Runs", "", f"Written by `apo-bench leaderboard`. {_RUNS}", "")
    yield from Table(lines, runs).markdown()
    yield ""
    yield from Table(list(same.items()), machines).markdown()


def _draw(lines: Sequence[Line], tracks: Sequence[str], out: Path) -> None:
    """Draw a matrix of entries and tracks; each cell is shaded by its score and shows it."""
    with use_figure_style({"font.size": 9.0}), warnings.catch_warnings():
        warnings.filterwarnings("ignore", "Glyph .* missing")  # a box replaces a letter that the font does not have
        from matplotlib.figure import Figure

        figure = Figure(figsize=(0.72 * len(tracks) + 3.0, 0.42 * len(lines) + 2.0), layout="constrained")
        axes = figure.subplots()
        scores = [[t.score if (t := line.entry.tracks.get(name)) else None for name in tracks] for line in lines]
        shown = axes.imshow(np.array(scores, dtype=float), vmin=0.0, vmax=100.0, cmap="Blues", aspect="auto")
        for y, row in enumerate(scores):
            for x, value in enumerate(row):
                if value is not None:
                    axes.text(x, y, f"{value:.0f}", ha="center", va="center", color="white" if value > 60 else "black")
        axes.set_xticks(range(len(tracks)), list(map(_shorten, tracks)), rotation=35, ha="right")
        axes.set_yticks(range(len(lines)), [_shorten(line.entry.name) for line in lines])
        figure.colorbar(shown, label="success [%]", shrink=0.8)
        save_figure(figure, out, dpi=110)


def _shorten(name: str) -> str:
    return name if len(name) <= _LONGEST_LABEL else f"{name[: _LONGEST_LABEL - 1]}…"


def _is_verified(entry: Entry, secret_seeds: frozenset[str]) -> bool:
    return all(track.secret_seed in secret_seeds for track in entry.tracks.values())


def _overall(entry: Entry) -> str | None:
    return None if (o := entry.overall) is None else f"{o[0]:.1f} ({o[1]:.1f} to {o[2]:.1f})"


def _score_words(name: str, line: Line) -> str | None:
    """Format the score of an entry in a track with its interval; in brackets, the rate of executed plans."""
    if (track := line.entry.tracks.get(name)) is None:
        return None
    executed = track.when_executed
    less = f" [{executed:.1f}]" if track.executed < track.trials and executed is not None else ""
    return f"{track.score:.1f} ({track.low:.0f} to {track.high:.0f}){less}"


def _brier(name: str, line: Line) -> str | None:
    """Format the Brier score of an entry in a track; None if it has none."""
    track = line.entry.tracks.get(name)
    return None if track is None or track.brier is None else f"{track.brier:.3f}"


def _machine_text(entry: Entry) -> str:
    return f"{', '.join(f'{name} {version}' for name, version in entry.versions.items())}; {entry.machine}"
