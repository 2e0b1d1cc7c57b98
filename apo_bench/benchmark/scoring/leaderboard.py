"""A table of entries: scores with intervals, one figure of all tracks, hashes of what was run."""

import warnings
from collections import Counter
from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np

from apo_bench.arguments import check_arguments
from apo_bench.benchmark.report.tables.table import Column, Table
from apo_bench.benchmark.scoring.entry import Entry, TrackScore, read_entry
from apo_bench.benchmark.scoring.track import read_track, track_names
from apo_bench.errors import InputError, require
from apo_bench.io import check_target, default_looks, grouped, save_figure, write_file

_PROVES = (
    "`self-reported` proves nothing: public seeds can be drawn again by whoever has the package. `verified` entries "
    "were run by whoever wrote this table, with trials drawn by a salt whose hash was published before; entrants that "
    "are not trusted ran as programs, which are given observations and nothing else. Entries marked `quick` ran a few "
    "trials, which are no score."
)
_EVERY = (
    "Success rate in percent, mean over the cells of a track, with its 95 % interval over seeds; in brackets that of "
    "the plans that were carried out, where some were not."
)
_SQUARE_IN = (0.72, 0.42)
_MARGIN_IN = (2.2, 1.1)
_MOST_SQUARES = 50
"""Entries, or tracks, that the figure shows; the tables have all."""
_USUAL_LABEL, _LONGEST_LABEL = 20, 40
"""Characters of a name in the figure: the margins have room for the first number, and grow up to the second."""
_LETTER_IN = 0.08


class Line(NamedTuple):
    """An entry in the table."""

    place: int
    entry: Entry
    verified: bool

    @property
    def status(self) -> str:
        return ("verified" if self.verified else "self-reported") + ", quick" * self.entry.quick


def ranked(entries: Sequence[Entry], salts: frozenset[str] = frozenset()) -> list[Line]:
    """Entries with the best first: those that entered more of the tracks that count stand before others.

    Args:
        salts: Hashes of salts that trials were drawn with by whoever writes the table.
    """
    count = {id(e): sum(track.overall for track in e.tracks.values()) for e in entries}
    order = sorted(entries, key=lambda e: (-count[id(e)], -(e.overall or (0.0,))[0], e.name))
    return [Line(i, entry, _is_verified(entry, salts)) for i, entry in enumerate(order, start=1)]


@check_arguments
def read_entries(folder: str | Path) -> tuple[list[Entry], list[str]]:
    """The entries of a folder (`*.json`), and a sentence for each file that is left out.

    A file is left out if it is not an entry, or is of another version of a track than most entries are.

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


def write_leaderboard(entries: Sequence[Entry], out: str | Path, salts: frozenset[str] = frozenset()) -> None:
    """Write the page, in Markdown, and its figure next to it.

    Args:
        entries: At least one, as `read_entries` gives them.

    Raises:
        InputError: The figure cannot be written.
    """
    tracks = _tracks(entries)
    lines = ranked(entries, salts)
    out = Path(out)
    picture = out.with_suffix(".png")
    check_target(out)
    _draw(lines[:_MOST_SQUARES], tracks[:_MOST_SQUARES], picture)
    write_file(out, "\n".join(_page(lines, tracks, picture.name)) + "\n")


def leaderboard_table(lines: Sequence[Line]) -> Table:
    """One line for each entry: its score over all tracks that count."""
    return Table(
        lines,
        (
            Column("place", "#"),
            Column("name", "entry", lambda line: line.entry.name, words=True),
            Column("score", "score", lambda line: _overall(line.entry)),
            Column("tracks", "tracks", lambda line: sum(track.overall for track in line.entry.tracks.values())),
            Column("status", "status", words=True),
        ),
    )


_Version = tuple[str, bool]
"""Hash of a track's file, and whether the track counts in the score over all."""


def _version(track: TrackScore) -> _Version:
    return track.track, track.overall


def _used_versions(entries: Sequence[Entry]) -> dict[str, _Version]:
    """The version of each track that most entries are of; of equally many that of the package, else the first."""
    stated = grouped((name, _version(track)) for entry in entries for name, track in entry.tracks.items())
    used = {}
    for name, versions in stated.items():
        count = Counter(versions)
        most = [version for version in count if count[version] == max(count.values())]
        own = _own_version(name) if len(most) > 1 else None
        used[name] = own if own in most else most[0]
    return used


def _own_version(name: str) -> _Version | None:
    """That of a track that comes with the package."""
    if name not in track_names():
        return None
    track = read_track(name)
    return track.hash, track.overall


def _tracks(entries: Sequence[Entry]) -> list[str]:
    """Names of all tracks, those that count first."""
    overall = {name: track.overall for entry in entries for name, track in entry.tracks.items()}
    return sorted(overall, key=lambda name: (not overall[name], name))


def _page(lines: Sequence[Line], tracks: Sequence[str], picture: str) -> Iterator[str]:
    yield from ("# Leaderboard", "", "Written by `apo-bench leaderboard`.", "", _PROVES, "")
    yield from leaderboard_table(lines).markdown()
    yield from ("", f"![Scores of entries in tracks]({picture})", "", "## Every track", "")
    yield from (_EVERY, "")
    columns = [Column(name, name, partial(_cell_in, name)) for name in tracks]
    yield from Table(lines, (Column("name", "entry", lambda line: line.entry.name, words=True), *columns)).markdown()
    yield from ("", "## Promises", "")
    promising = [(line.entry, name) for line in lines for name in tracks if _promises(line.entry.tracks.get(name))]
    yield from Table(
        promising,
        (
            Column("entry", "entry", lambda pair: pair[0].name, words=True),
            Column("track", "track", lambda pair: pair[1], words=True),
            Column(
                "predicted_success",
                "predicted_success",
                lambda pair: _percent(pair[0].tracks[pair[1]].predicted_success),
            ),
            Column("score", "score", lambda pair: f"{pair[0].tracks[pair[1]].score:.1f}"),
            Column("brier", "Brier score", lambda pair: f"{pair[0].tracks[pair[1]].brier:.3f}"),
        ),
        "No entry promises anything.",
    ).markdown()
    yield from ("", "## What was run", "")
    runs = [(line.entry, name, track) for line in lines for name, track in line.entry.tracks.items()]
    yield from Table(
        runs,
        (
            Column("entry", "entry", lambda run: run[0].name, words=True),
            Column("track", "track", lambda run: run[1], words=True),
            Column("trials", "trials", lambda run: run[2].trials),
            Column("file", "track file", lambda run: run[2].track, words=True),
            Column("code", "code", lambda run: run[2].code, words=True),
            Column("rows", "rows", lambda run: run[2].rows, words=True),
        ),
    ).markdown()
    yield ""
    yield from Table(
        [line.entry for line in lines],
        (
            Column("name", "entry", words=True),
            Column("command", "command", words=True),
            Column("versions", "versions", _versions_text, words=True),
            Column("machine", "machine", words=True),
        ),
    ).markdown()


def _draw(lines: Sequence[Line], tracks: Sequence[str], out: Path) -> None:
    """A square for every entry and track, darker where more trials succeeded, with its number."""
    with default_looks({"font.size": 9.0}), warnings.catch_warnings():
        warnings.filterwarnings("ignore", "Glyph .* missing")  # a box stands for a letter that the font does not have
        from matplotlib.figure import Figure

        names, methods = list(map(_label, tracks)), [_label(line.entry.name) for line in lines]
        more = _LETTER_IN * max(0, max(map(len, (*names, *methods))) - _USUAL_LABEL)
        width, height = (
            n * step + margin + more
            for n, step, margin in zip((len(tracks), len(lines)), _SQUARE_IN, _MARGIN_IN, strict=True)
        )
        figure = Figure(figsize=(width, height), layout="constrained")
        axes = figure.subplots()
        scores = [[_score(line.entry.tracks.get(name)) for name in tracks] for line in lines]
        filled = np.array(scores, dtype=float)  # what was not entered is nan
        shown = axes.imshow(filled, vmin=0.0, vmax=100.0, cmap="Blues", aspect="auto")
        for y, row in enumerate(scores):
            for x, value in enumerate(row):
                if value is not None:
                    axes.text(x, y, f"{value:.0f}", ha="center", va="center", color="white" if value > 60 else "black")
        axes.set_xticks(range(len(tracks)), names, rotation=35, ha="right")
        axes.set_yticks(range(len(lines)), methods)
        figure.colorbar(shown, label="success [%]", shrink=0.8)
        save_figure(figure, out, dpi=110)


def _label(name: str) -> str:
    return name if len(name) <= _LONGEST_LABEL else f"{name[: _LONGEST_LABEL - 1]}…"


def _is_verified(entry: Entry, salts: frozenset[str]) -> bool:
    return all(track.secret_seed in salts for track in entry.tracks.values())


def _overall(entry: Entry) -> str | None:
    return None if (o := entry.overall) is None else f"{o[0]:.1f} ({o[1]:.1f} to {o[2]:.1f})"


def _cell_in(name: str, line: Line) -> str | None:
    """What an entry scored in a track, as text."""
    if (track := line.entry.tracks.get(name)) is None:
        return None
    carried = track.when_executed
    less = f" [{carried:.1f}]" if track.executed < track.trials and carried is not None else ""
    return f"{track.score:.1f} ({track.low:.0f} to {track.high:.0f}){less}"


def _score(track: TrackScore | None) -> float | None:
    return None if track is None else track.score


def _promises(track: TrackScore | None) -> bool:
    return track is not None and track.brier is not None


def _percent(share: float | None) -> str | None:
    return None if share is None else f"{100.0 * share:.1f}"


def _versions_text(entry: Entry) -> str:
    return ", ".join(f"{name} {version}" for name, version in entry.versions.items())
