"""The leaderboard: a page with a table of entries, their scores and intervals, and a figure."""

import warnings
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import NamedTuple

from apo_bench.arguments import check_arguments
from apo_bench.benchmark.analysis import MeanEstimate, format_signed, pool_estimates
from apo_bench.benchmark.analysis.paired import adjust_by_holm
from apo_bench.benchmark.report.tables.table import Table, TableColumn
from apo_bench.benchmark.scoring.entry import LEAST_TRIALS, Entry, TrackScore, compare_entries, read_entry
from apo_bench.benchmark.scoring.track import read_track, track_names
from apo_bench.errors import InputError, require
from apo_bench.io import check_target, group_by, save_figure, use_figure_style, write_file

REFERENCE = "contact"
"""Name of the entry that all others are compared with."""
_BOUNDS = ("uncorrected", "oracle")
"""Names of the entries at 0 and at 100 % of the headroom."""
_STATUS = (
    "A `self-reported` entry is unverified, since anyone can draw public seeds again. The author of this table ran "
    "`verified` entries with trials of a secret seed, whose hash was published before; entrants that are not trusted "
    "ran as programs, which get observations and nothing else. `real` entries are forms of trials with a real robot. "
    f"Entries with `few trials` have less than {LEAST_TRIALS} in a condition."
)
_SCORES = (
    "The score is the mean success rate over the tracks, in percent. The difference to `contact` is in points, over "
    "the trials that both have; p is adjusted for all comparisons (Holm). All intervals are 95 % intervals; n is the "
    "number of trials. An entry without all tracks has no score, and stands below, by track."
)
_RATES = (
    "Success rate in percent, mean over the conditions of a track, with its 95 % interval. In brackets: the rate of "
    "executed plans, where some were not executed; n is the number of trials."
)
_APART = "Difference to `contact` in points, over the trials that both have, with its 95 % interval."
_HEADROOM = "Share of the way from `uncorrected` (0) to `oracle` (100), in percent: what the robot leaves to a method."
_BRIER = (
    "Brier score of the predicted success (0 is best, 0.25 is a coin), and in brackets its reliability: the mean "
    "squared difference of predicted success and success rate in ten classes; 0 is calibrated."
)
_RUNS = "The file of each entry also has the hashes of tracks, code and records."
_MOST_SQUARES = 50
"""Most entries, and most tracks, in the figure; the tables have all."""
_PANELS = 4
"""Tracks side by side in the figure."""
_LONGEST_LABEL = 30  # letters of a label of the figure


class Line(NamedTuple):
    """A line of the table: an entry with its place, and its differences to the reference."""

    place: int
    entry: Entry
    verified: bool
    score: tuple[float, float, float] | None
    """Overall score and its interval; None of an entry without all tracks."""
    differences: Mapping[str, MeanEstimate]
    """Track -> difference to the reference, in points; empty for the reference."""
    difference: MeanEstimate | None
    """Mean difference over the tracks that count; None without a score, or a track without common trials."""
    p: float | None
    """p-value of the difference, adjusted for all comparisons."""

    @property
    def status(self) -> str:
        status = "verified" if self.verified else "self-reported"
        return "real, " * self.entry.real + status + ", few trials" * self.entry.has_few_trials

    @property
    def trials(self) -> int:
        return sum(track.trials for track in self.entry.tracks.values())


def ranked(entries: Sequence[Entry], secret_seeds: frozenset[str] = frozenset()) -> list[Line]:
    """Rank entries: those with all tracks by overall score, then the others by the number of their tracks.

    Args:
        secret_seeds: Hashes of the secret seeds with which the author of the table drew trials.
    """
    counting = {name for entry in entries for name, track in entry.tracks.items() if track.overall}
    scores = {id(e): e.overall if counting <= e.tracks.keys() else None for e in entries}
    order = sorted(entries, key=lambda e: (-(scores[id(e)] or (-1.0,))[0], -len(e.tracks), e.name))
    reference = next((entry for entry in order if entry.name == REFERENCE), None)
    lines = []
    for i, entry in enumerate(order, start=1):
        found = {} if reference is None or entry is reference else compare_entries(entry, reference)
        those = [found[name] for name in sorted(counting & found.keys())]
        whole = pool_estimates(those) if scores[id(entry)] and those and counting <= found.keys() else None
        verified = _is_verified(entry, secret_seeds)
        lines.append(Line(i, entry, verified, scores[id(entry)], found, whole, None))
    p = adjust_by_holm({line.place: line.difference.p for line in lines if line.difference is not None})
    return [line._replace(p=p.get(line.place)) for line in lines]


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
    """Return the main table: one line per entry with a score."""
    return Table(
        [line for line in lines if line.score is not None],
        (
            TableColumn("place", "#"),
            TableColumn("name", "entry", "entry.name", words=True),
            TableColumn("score", "score", lambda line: "{:.1f} ({:.1f} to {:.1f})".format(*line.score)),
            TableColumn("difference", f"difference to {REFERENCE}", lambda line: _difference_text(line.difference)),
            TableColumn("p", "p", text="{p:p}"),
            TableColumn("trials", "n"),
            TableColumn("status", "status", words=True),
        ),
        "No entry has all tracks.",
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

    def by_track(value: Callable[[str, Line], str | None], chosen: Sequence[Line] = lines) -> Iterator[str]:
        columns = (TableColumn(name, name, partial(value, name)) for name in tracks)
        yield from Table(chosen, (entry, *columns)).markdown()

    runs = (
        entry,
        TableColumn("trials", "trials"),
        TableColumn("revision", "revision", lambda line: line.entry.revision[:12], words=True),
        TableColumn("command", "command", "entry.command", words=True),
    )
    same = group_by((_machine_text(line.entry), line.entry.name) for line in lines)
    machine = TableColumn("machine", "versions and machine", lambda group: group[0], words=True)
    machines = (TableColumn("entries", "entries", lambda group: ", ".join(group[1]), words=True), machine)
    named = {line.entry.name: line.entry for line in lines}
    yield from ("# Leaderboard", "", f"{len(lines)} entries, the best first.", "")
    yield from leaderboard_table(lines).markdown()
    yield from ("", _SCORES, "", _STATUS, "", f"![Scores of entries in tracks]({picture})", "", "## Tracks", "")
    yield from (_RATES, "")
    yield from by_track(_score_words)
    compared = [line for line in lines if line.differences]
    if compared:
        yield from ("", f"## Differences to {REFERENCE}", "", _APART, "")
        yield from by_track(lambda name, line: _difference_text(line.differences.get(name)), compared)
    if set(_BOUNDS) <= named.keys():
        low, high = (named[name] for name in _BOUNDS)
        yield from ("", "## Headroom", "", _HEADROOM, "")
        yield from by_track(lambda name, line: _headroom(line.entry, low, high, name))
    yield from ("", "## Predicted success", "", _BRIER, "")
    yield from by_track(_brier)
    yield from ("", "## Runs", "", f"Written by `apo-bench leaderboard`. {_RUNS}", "")
    yield from Table(lines, runs).markdown()
    yield ""
    yield from Table(list(same.items()), machines).markdown()


def _draw(lines: Sequence[Line], tracks: Sequence[str], out: Path) -> None:
    """Draw a panel for each track, with a dot and its interval for each entry."""
    with use_figure_style({"font.size": 9.0}), warnings.catch_warnings():
        warnings.filterwarnings("ignore", "Glyph .* missing")  # a box replaces a letter that the font does not have
        from matplotlib.figure import Figure

        columns = min(_PANELS, len(tracks))
        rows = -(-len(tracks) // columns)
        size = (2.2 * columns + 1.6, (0.22 * len(lines) + 0.7) * rows + 0.4)
        figure = Figure(figsize=size, layout="constrained")
        panels = figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False).ravel()
        for axes, name in zip(panels, tracks, strict=False):
            shown = [(y, track) for y, line in enumerate(lines) if (track := line.entry.tracks.get(name)) is not None]
            scores = [track.score for _, track in shown]
            apart = [[track.score - track.low for _, track in shown], [track.high - track.score for _, track in shown]]
            axes.errorbar(scores, [y for y, _ in shown], xerr=apart, fmt="o", markersize=3.5, elinewidth=1.2)
            axes.set_title(_shorten(name), fontsize=9.0)
            axes.grid(axis="x", linewidth=0.4, alpha=0.5)
        for axes in panels[len(tracks) :]:
            axes.set_visible(False)
        panels[0].set(xlim=(-3, 103), ylim=(len(lines) - 0.5, -0.5))
        panels[0].set_yticks(range(len(lines)), [_shorten(line.entry.name) for line in lines])
        figure.supxlabel("success [%], 95 % interval", fontsize=9.0)
        save_figure(figure, out, dpi=110)


def _shorten(name: str) -> str:
    return name if len(name) <= _LONGEST_LABEL else f"{name[: _LONGEST_LABEL - 1]}…"


def _is_verified(entry: Entry, secret_seeds: frozenset[str]) -> bool:
    return all(track.secret_seed in secret_seeds for track in entry.tracks.values())


def _difference_text(apart: MeanEstimate | None) -> str | None:
    """Format a difference in points with its interval: `+4.0 (+1.2 to +6.9)`."""
    if apart is None:
        return None
    value, low, high = (format_signed(x, 1) for x in (apart.value, *apart.interval))
    return f"{value} ({low} to {high})"


def _headroom(entry: Entry, low: Entry, high: Entry, name: str) -> str | None:
    """Format the headroom that an entry uses in a track; None if a bound has no score there or both are equal."""
    scores = [each.tracks[name].score if name in each.tracks else None for each in (entry, low, high)]
    if None in scores or scores[1] == scores[2]:
        return None
    own, least, most = (float(score or 0.0) for score in scores)
    return f"{100.0 * (own - least) / (most - least):.0f}"


def _score_words(name: str, line: Line) -> str | None:
    """Format the score of an entry in a track with its interval; in brackets, the rate of executed plans."""
    if (track := line.entry.tracks.get(name)) is None:
        return None
    executed = track.when_executed
    less = f" [{executed:.1f}]" if track.executed < track.trials and executed is not None else ""
    return f"{track.score:.1f} ({track.low:.0f} to {track.high:.0f}){less}, n {track.trials}"


def _brier(name: str, line: Line) -> str | None:
    """Format Brier score and reliability of an entry in a track; None if it has none."""
    track = line.entry.tracks.get(name)
    return None if track is None or track.brier is None else f"{track.brier:.3f} [{track.reliability:.3f}]"


def _machine_text(entry: Entry) -> str:
    return f"{', '.join(f'{name} {version}' for name, version in entry.versions.items())}; {entry.machine}"
