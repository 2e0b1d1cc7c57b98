"""The scores of an entry as text."""

from collections.abc import Iterator

from apo_bench.benchmark.scoring.entry import Entry, TrackScore


def entry_lines(entry: Entry) -> Iterator[tuple[str, str]]:
    """Name, score and remarks of each track, and of all."""
    for name, track in entry.tracks.items():
        yield name, f"{_interval(track.score, track.low, track.high)}  {', '.join(_remarks(track))}"
    if entry.overall is not None:
        few = "  too few trials for a score (--quick)" if entry.quick else ""
        yield "all", f"{_interval(*entry.overall)}{few}"


def _interval(score: float, low: float, high: float) -> str:
    return f"{score:5.1f}  ({low:.1f} to {high:.1f})"


def _remarks(track: TrackScore) -> Iterator[str]:
    yield f"{track.trials} trials"
    if not track.executed:
        yield "none of which the robot executed: the records beside the entry say why"
    elif track.executed < track.trials and track.when_executed is not None:
        yield f"{track.when_executed:.1f} % of the {track.executed} that the robot executed"
    if track.brier is not None:
        yield f"Brier score of the predicted success {track.brier:.3f}"
    if not track.overall:
        yield "not in the score over all"
