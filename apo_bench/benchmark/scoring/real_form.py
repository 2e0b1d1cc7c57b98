"""Make an entry from the form of a kit: trials with a real robot, judged by the thresholds of the scenario."""

import hashlib
import json
from pathlib import Path

import msgspec

from apo_bench import __version__
from apo_bench.arguments import check_arguments
from apo_bench.benchmark.scoring.entry import EXCLUDED, RIGHT, SCHEMA, WRONG, Entry, TrackScore, check_name, score_of
from apo_bench.errors import require
from apo_bench.formats.kit import FORM_COLUMNS
from apo_bench.io import CsvRow, read_bytes, read_csv
from apo_bench.records import Criteria
from apo_bench.scenario import load_scenario
from apo_bench.trial.fingerprint import find_git_revision

_HEX = 16  # digits of a hash
_LARGEST_MM = 1000.0  # largest length in a form
_ANSWERS = {"yes": True, "no": False}
_MEASURED = ("fit_gap_mm", "support_gap_mm", "overlap_percent", "slid_mm")  # columns of measured lengths and overlaps


@check_arguments
def read_real_entry(form: str | Path, method: str, name: str | None = None, command: str = "") -> Entry:
    """Read the trials of a method from a filled-in form.

    Args:
        form: `form.csv` of a kit, with one scenario and one clearance.
        method: The method; lines of other methods are left out.
        name: The name in tables; default: the method.
        command: The command line, for the entry.

    Raises:
        InputError: A cell is invalid, a trial occurs twice, or the method has no line.
    """
    check_name("entry", name or method)
    rows = list(read_csv(form, FORM_COLUMNS, [column for column in FORM_COLUMNS if column != "note"]))
    rows = [row for row in rows if row.text("method") == method]
    require(rows, f"{form}: no line has the method '{method}'; name one that the form has.")
    scenario, clearance_mm = rows[0].text("scenario"), rows[0].number("clearance_mm", _LARGEST_MM)
    thresholds = load_scenario(scenario).thresholds
    criteria = Criteria(thresholds, clearance_mm)
    trials: dict[int, str] = {}
    for row in rows:
        row.require(row.text("scenario") == scenario, "scenario", f"one scenario in a form ({scenario}) is needed")
        same = row.number("clearance_mm", _LARGEST_MM) == clearance_mm
        row.require(same, "clearance_mm", f"one clearance in a form ({clearance_mm:g}) is needed")
        trial = int(row.number("trial", 1e6))
        row.require(trial not in trials, "trial", "each trial once for each method is needed")
        trials[trial] = judge_row(row, criteria)
    return _entry(scenario, criteria, method, name or method, command, "".join(trials[k] for k in sorted(trials)), form)


def judge_row(row: CsvRow, criteria: Criteria) -> str:
    """Judge one line of a form as the judge does a simulated trial; return its letter in an entry.

    Measurements may be empty if the assembly did not end.
    """
    answers = {}
    for column in ("demonstration_right", "ended", "at_rest"):
        row.require(row.text(column).lower() in _ANSWERS, column, "yes or no is needed")
        answers[column] = _ANSWERS[row.text(column).lower()]
    if not answers["demonstration_right"]:
        return EXCLUDED
    if not (answers["ended"] and answers["at_rest"]):
        return WRONG
    fit_mm, support_mm, overlap_percent, slid_mm = (row.number(column, _LARGEST_MM) for column in _MEASURED)
    limits = criteria.thresholds
    holds = (
        fit_mm <= criteria.clearance_mm + limits.fit_margin_mm
        and support_mm <= limits.support_mm
        and overlap_percent >= 100.0 * limits.overlap_fraction
        and slid_mm <= limits.placed_part_shift_mm
    )
    return RIGHT if holds else WRONG


def _entry(
    scenario: str, criteria: Criteria, method: str, name: str, command: str, trials: str, form: str | Path
) -> Entry:
    """Return an entry with one track: the scenario with its thresholds, which does not count in the overall score."""
    conditions = {f"real|{scenario}|{criteria.clearance_mm:g} mm": trials}
    score, low, high = score_of(conditions)
    counted = len(trials) - trials.count(EXCLUDED)
    task = json.dumps([scenario, msgspec.to_builtins(criteria)]).encode()
    track = TrackScore(
        track=_digest(task),
        overall=False,
        score=score,
        low=low,
        high=high,
        trials=counted,
        executed=counted,
        predicted_success=None,
        brier=None,
        reliability=None,
        records=_digest(read_bytes(form, "form")),
        code=_digest(__version__.encode()),
        secret_seed=None,
        conditions=conditions,
    )
    tracks = {f"real-{scenario}": track}
    return Entry(
        schema=SCHEMA,
        name=name,
        method=method,
        command=command,
        versions={"apo_bench": __version__},
        revision=find_git_revision(),
        machine="real robot",
        tracks=tracks,
        real=True,
    )


def _digest(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()[:_HEX]
