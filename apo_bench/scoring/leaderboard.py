"""A table of entries: scores with intervals, paired differences from row to row, one figure of all tracks, hashes."""

import re
from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np

from apo_bench.arguments import check_arguments
from apo_bench.errors import require
from apo_bench.io import clean, default_looks, save_figure
from apo_bench.report.tables.table import Column, Table
from apo_bench.scoring.entry import EXCLUDED, RIGHT, Entry, TrackScore, read_entry
from apo_bench.statistics import Results, contrast, points

_PROVES = (
    "`self-reported` proves nothing: public seeds can be drawn again by whoever has the package. `verified` entries "
    "were run by whoever wrote this table, with trials drawn by a salt whose hash was published before; the entrant "
    "ran in a process of its own that was given observations and nothing else. Entries marked `quick` ran a few "
    "trials, which are no score."
)
_PAIRED = (
    "Score minus that of the row above, in points, over the trials that both have, of all tracks that both entered; "
    "trials of one seed are not independent, and the 95 % interval is one over seeds. Methods that know the truth have "
    "no trial in common with others."
)
_EVERY = (
    "Success rate in percent, mean over the cells of a track, with its 95 % interval over seeds; in brackets that of "
    "the plans that were carried out, where some were not."
)
_SQUARE_IN = (0.72, 0.42)
_MARGIN_IN = (2.2, 1.1)


class Line(NamedTuple):
    """An entry in the table."""

    place: int
    entry: Entry
    above: Entry | None
    """The entry of the row above."""
    verified: bool

    @property
    def status(self) -> str:
        return ("verified" if self.verified else "self-reported") + ", quick" * self.entry.quick

    @property
    def difference(self) -> str | None:
        """To the row above."""
        if self.above is None or (pair := contrast(_results(self.entry), _results(self.above))) is None:
            return None
        return points(pair.difference, pair.interval)


def ranked(entries: Sequence[Entry], salts: frozenset[str] = frozenset()) -> list[Line]:
    """Entries with the best first: those that entered more of the tracks that count stand before others.

    Args:
        salts: Hashes of salts that trials were drawn with by whoever writes the table.
    """
    count = {id(e): sum(track.overall for track in e.tracks.values()) for e in entries}
    order = sorted(entries, key=lambda e: (-count[id(e)], -(e.overall or (0.0,))[0], e.name))
    return [
        Line(i + 1, entry, order[i - 1] if i else None, _is_verified(entry, salts)) for i, entry in enumerate(order)
    ]


@check_arguments
def write_leaderboard(folder: str | Path, out: str | Path, salts: frozenset[str] = frozenset()) -> int:
    """Write the page, in Markdown, and its figure beside it; return how many entries it has.

    Args:
        folder: Entries, `*.json`.

    Raises:
        InputError: No entry, one that cannot be read, or entries of different files of one track.
    """
    entries = [read_entry(path) for path in sorted(Path(folder).glob("*.json"))]
    require(entries, f"'{folder}' has no entry; give a folder of files that `apo-bench score --out` wrote.")
    tracks = _tracks(entries)
    lines = ranked(entries, salts)
    out = Path(out)
    picture = out.with_suffix(".png")
    _draw(lines, tracks, picture)
    out.write_text("\n".join(_page(lines, tracks, picture.name)) + "\n", encoding="utf-8")
    return len(entries)


def leaderboard_table(lines: Sequence[Line]) -> Table:
    """One line for each entry: its score over all tracks that count, and to the row above."""
    return Table(
        lines,
        (
            Column("place", "#"),
            Column("name", "entry", lambda line: _plain(line.entry.name), words=True),
            Column("score", "score", lambda line: _overall(line.entry)),
            Column("tracks", "tracks", lambda line: sum(track.overall for track in line.entry.tracks.values())),
            Column("difference", "to the row above"),
            Column("status", "status", words=True),
        ),
    )


def _tracks(entries: Sequence[Entry]) -> list[str]:
    """Names of all tracks, those that count first."""
    files: dict[str, TrackScore] = {}
    for entry in entries:
        for name, track in entry.tracks.items():
            first = files.setdefault(name, track)
            require(
                (first.track, first.overall) == (track.track, track.overall),
                f"the entry '{entry.name}' is of another version of the track {name} ({track.track}, not "
                f"{first.track}); score it anew, or leave it out.",
            )
    return sorted(files, key=lambda name: (not files[name].overall, name))


def _page(lines: Sequence[Line], tracks: Sequence[str], picture: str) -> Iterator[str]:
    yield from ("# Leaderboard", "", "Written by `apo-bench leaderboard`.", "", _PROVES, "")
    yield from leaderboard_table(lines).markdown()
    yield from ("", f"![Scores of all entries in all tracks]({picture})", "", _PAIRED, "", "## Every track", "")
    yield from (_EVERY, "")
    columns = [Column(name, name, partial(_cell_in, name)) for name in tracks]
    yield from Table(lines, (Column("name", "entry", lambda x: _plain(x.entry.name), words=True), *columns)).markdown()
    yield from ("", "## Promises", "")
    promising = [(line.entry, name) for line in lines for name in tracks if _promises(line.entry.tracks.get(name))]
    yield from Table(
        promising,
        (
            Column("entry", "entry", lambda pair: _plain(pair[0].name), words=True),
            Column("track", "track", lambda pair: pair[1], words=True),
            Column("promised", "promised", lambda pair: _percent(pair[0].tracks[pair[1]].promised)),
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
            Column("entry", "entry", lambda run: _plain(run[0].name), words=True),
            Column("track", "track", lambda run: run[1], words=True),
            Column("trials", "trials", lambda run: run[2].trials),
            Column("file", "track file", lambda run: f"`{run[2].track}`", words=True),
            Column("code", "code", lambda run: f"`{run[2].code}`", words=True),
            Column("rows", "rows", lambda run: f"`{run[2].rows}`", words=True),
        ),
    ).markdown()
    yield ""
    for line in lines:
        versions = ", ".join(f"{name} {version}" for name, version in line.entry.versions.items())
        command = _plain(line.entry.command, ticks="'")
        yield f"- {_plain(line.entry.name)}: `{command}`; {_plain(versions)}; {_plain(line.entry.machine)}"


def _draw(lines: Sequence[Line], tracks: Sequence[str], out: Path) -> None:
    """A square for every entry and track, darker where more trials succeeded, with its number."""
    with default_looks({"font.size": 9.0}):
        from matplotlib.figure import Figure

        size = [
            n * step + margin for n, step, margin in zip((len(tracks), len(lines)), _SQUARE_IN, _MARGIN_IN, strict=True)
        ]
        figure = Figure(figsize=(size[0], size[1]), layout="constrained")
        axes = figure.subplots()
        scores = [[_score(line.entry.tracks.get(name)) for name in tracks] for line in lines]
        filled = np.array(scores, dtype=float)  # what was not entered is nan
        shown = axes.imshow(filled, vmin=0.0, vmax=100.0, cmap="Blues", aspect="auto")
        for y, row in enumerate(scores):
            for x, value in enumerate(row):
                if value is not None:
                    axes.text(x, y, f"{value:.0f}", ha="center", va="center", color="white" if value > 60 else "black")
        axes.set_xticks(range(len(tracks)), tracks, rotation=35, ha="right")
        axes.set_yticks(range(len(lines)), [line.entry.name for line in lines])
        figure.colorbar(shown, label="success [%]", shrink=0.8)
        save_figure(figure, out, dpi=110)


def _plain(text: str, ticks: str = "\\`") -> str:
    """What somebody wrote, on one line of a table, without meaning to Markdown or HTML."""
    line = " ".join(clean(text).split()).replace("`", ticks)
    return re.sub(r"([|*_<>\[\]])", r"\\\1", line) if ticks != "'" else line.replace("|", "/")


def _is_verified(entry: Entry, salts: frozenset[str]) -> bool:
    return bool(entry.tracks) and all(track.salt in salts for track in entry.tracks.values())


def _results(entry: Entry) -> Results:
    """Track and cell, and number of the trial -> success."""
    return {
        (name, cell, number): letter == RIGHT
        for name, track in entry.tracks.items()
        for cell, trials in track.cells.items()
        for number, letter in enumerate(trials)
        if letter != EXCLUDED
    }


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
