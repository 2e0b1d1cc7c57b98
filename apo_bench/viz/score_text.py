"""An entry as text."""

from collections.abc import Iterator

from apo_bench.benchmark.scoring.entry import Entry, TrackScore


def entry_lines(entry: Entry) -> Iterator[str]:
    """One line for each track, and one for all."""
    width = max(map(len, entry.tracks), default=0)
    for name, track in entry.tracks.items():
        yield f"{name:{width}}  {_line(track)}"
    if (overall := entry.overall) is not None:
        few = "; --quick: too few trials for a score" if entry.quick else ""
        yield f"{'all':{width}}  {overall[0]:5.1f}  ({overall[1]:.1f} to {overall[2]:.1f}){few}"


def _line(track: TrackScore) -> str:
    said = f"{track.score:5.1f}  ({track.low:.1f} to {track.high:.1f})  {track.trials} trials"
    if track.executed < track.trials and track.when_executed is not None:
        said += f", {track.when_executed:.1f} % of the {track.executed} that were carried out"
    if not track.executed:
        said += ", none of which was carried out: the rows in the folder beside the entry say why"
    if track.brier is not None:
        said += f", Brier score of promises {track.brier:.3f}"
    return said if track.overall else f"{said}; not in the score over all"
