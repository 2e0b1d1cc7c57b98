"""The page of a sweep: the answer, who succeeds, where and why not, with every trial under its cell.

Pages out of templates: one file, no address outside it, and a policy that lets a browser load none.
"""

import base64
import hashlib
import re
from collections.abc import Iterable, Mapping, Sequence
from functools import cache
from importlib import resources
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup, escape

from apo_bench.io import grouped
from apo_bench.records import RANGE, Limits, Row, knows_truth, look_up, one_salt
from apo_bench.records.run.replay_command import Files, replay_command
from apo_bench.report.figures.sheet import DrawnFigure, dark_properties
from apo_bench.report.page.cells import matrices, packed_json, trials
from apo_bench.report.run.trials import FailurePicture, limits_of, run_facts, scenario_files, why
from apo_bench.report.tables.table import Table
from apo_bench.statistics import Cell, Setting, Work, cell_place, place_of, setting_of
from apo_bench.statistics.levels.half_level import Summary


def page(template: str, **values: Any) -> str:
    """HTML in one piece; whatever is not markup by its type is escaped.

    Args:
        template: `report.html` or `compare.html`.
        values: For the template: `title`, `sections` (anchor -> heading), and what it needs itself.
    """
    script = _file("page.js")
    dark = f"@media (prefers-color-scheme:dark){{:root{{{dark_properties()}}}}}"
    known = base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()
    policy = (
        f"default-src 'none'; img-src data:; style-src 'unsafe-inline'; script-src 'sha256-{known}'; "
        "base-uri 'none'; form-action 'none'"
    )
    return (
        _templates()
        .get_template(f"{template}.j2")
        .render(script=Markup(script), style=Markup(_file("page.css") + dark), policy=policy, **values)
    )


def prose(text: str) -> Markup:
    """Sentences in which `code` and *emphasis* are marked as in Markdown; `%` stays with its number."""
    code = re.sub(r"`([^`]+)`", r"<code>\1</code>", str(escape(text)).replace(" %", "\u00a0%"))
    return Markup(re.sub(r"\*([^*]+)\*", r"<em>\1</em>", code))


@cache
def _templates() -> Environment:
    environment = Environment(
        loader=PackageLoader("apo_bench.report.page"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters |= {"prose": prose, "zip": zip}
    return environment


@cache
def _file(name: str) -> str:
    """A style sheet or script that lies beside this module."""
    return resources.files(__package__).joinpath(name).read_text(encoding="utf-8")


_SECTIONS = {
    "success": "Success",
    "levels": "Success over level",
    "pairs": "Paired differences",
    "stages": "Where trials failed",
    "pictures": "Some failures",
    "gaps": "Gap before and after correction",
    "prediction": "Prediction and physics",
    "felt": "What robots felt about themselves",
    "effort": "What it takes",
    "calibration": "Calibration",
    "recognised": "Recognised contacts",
    "timing": "Timing",
    "run": "What was run",
}
_SUCCESS = (
    "Success, that the finished assembly is right, with Wilson's 95 % interval and the number of trials; below it, "
    "where it is not the same, how many were also made as demonstrated: each contact when and where it was shown. "
    "A cell opens its trials, each with the command that runs it again. `oracle` replays the drawn layout, without "
    "noise or carelessness; `none` replays what was seen; neither is told what touches what. A method that refuses or "
    "does not converge counts as failed; success among the trials that were carried out stands below where it differs. "
    "Demonstrations that were not right themselves are left out of every method."
)


def report_page(
    name: str,
    answer: str,
    rows: Sequence[Row],
    summary: Summary,
    grouped: Mapping[Setting, Sequence[Cell]],
    figures: Mapping[str, DrawnFigure],
    tables: Mapping[str, Table],
    run: Mapping[str, Any],
    work: Sequence[Work],
    timed: int,
    pictures: Sequence[FailurePicture],
    no_pictures: Sequence[str],
    beside: Sequence[str],
) -> str:
    """The page, as HTML.

    Args:
        name: Of the folder.
        answer: The sentences at the top, with `code` marked.
        grouped: The cells of each setting.
        run: What `run.json` says.
        timed: Trials whose time is known.
        no_pictures: Why pictures are missing, in sentences.
        beside: Files beside the page, relative to it.
    """
    cells = summary.cells
    limits = limits_of(run)
    files = scenario_files(run)
    numbers = {cell_place(cell): i for i, cell in enumerate(cells)}
    shown = [(place_of(picture.row), picture.row["seed"]) for picture in pictures]
    pictured = {(numbers[place], seed): k for k, (place, seed) in enumerate(shown) if place in numbers}
    return page(
        "report.html",
        title=name if "sweep" in name.lower() else f"Sweep {name}",
        sections=_SECTIONS,
        answer=answer,
        scope=_scope(rows),
        words={
            "success": f"{_level_meaning(rows)} {_SUCCESS}",
            "levels": "Bands are Wilson's 95 % intervals; methods stand a little apart so that equal rates do not hide "
            "each other.",
            "run": _run_words(rows),
        },
        matrices=matrices(grouped, numbers),
        still=_still(cells),
        figures=figures,
        tables=tables,
        references=[
            reference
            for reference in dict.fromkeys(p.reference for p in summary.pairs)
            if f"difference_to_{reference}" in figures
        ],
        pictures=[_picture(picture, files, limits) for picture in pictures],
        no_pictures="; ".join(no_pictures),
        timed=_timed(timed, work),
        facts=run_facts(run, _facts_of(rows, work)),
        command_line=run.get("command"),
        no_run="" if run else "There is no run.json beside the rows, so versions and command are not known.",
        beside=beside,
        trials=packed_json(trials(rows, cells, files, pictured, limits)),
    )


def _scope(rows: Sequence[Row]) -> str:
    """What was tried, and what was left out."""

    def demonstrations(some: Iterable[Row]) -> int:
        return len({(row["scenario"], row["clearance_mm"], row["seed"], row["careless"]) for row in some})

    excluded = demonstrations(row for row in rows if row["success"] is None)
    tried = demonstrations(rows)
    scenarios, methods, seeds = (_many(len({row[x] for row in rows}), x) for x in ("scenario", "method", "seed"))
    fidelity = ", ".join(sorted({str(row["fidelity"]) for row in rows}))
    left_out = f"{'The 1 demonstration was' if tried == 1 else f'All {tried:,} demonstrations were'} right."
    if excluded:
        were = "was not right itself and is" if excluded == 1 else "were not right themselves and are"
        left_out = f"{excluded:,} of {_many(tried, 'demonstration')} {were} left out."
    return f"{len(rows):,} trials of {scenarios}, {methods} and {seeds}, fidelity {fidelity}. {left_out}"


def _level_meaning(rows: Sequence[Row]) -> str:
    """What a level is, for the sensors that looked."""
    noises = {row["noise"] for row in rows}
    if noises == {RANGE}:
        return "A level of L is a standard deviation of L mm per ray of the range finder."
    also = "; seen by the range finder (noise `range`), of L mm per ray" if RANGE in noises else ""
    return (
        "A level of L is a standard deviation of L mm and L degrees per axis, times what the noise model makes of it "
        f"in a direction or for a part{also}."
    )


def _still(cells: Sequence[Cell]) -> str:
    """A sentence where no level varies."""
    levels = grouped((setting_of(cell_place(c)), c.level) for c in cells if not knows_truth(c.method))
    if any(len(set(own)) > 1 for own in levels.values()):
        return ""
    here = sorted({f"{level:g}" for own in levels.values() for level in own})
    what = f"every trial was at level {here[0]}" if len(here) == 1 else "no setting has two levels"
    return f"No level varied: {what}, so there is no curve."


def _picture(picture: FailurePicture, files: Files, limits: Limits) -> dict[str, str]:
    row = picture.row
    place = place_of(row)
    where = "" if place is None else f"{setting_of(place).title()}, level {place.level:g}, "
    return {
        "title": f"{row['method']}: {why(row)}.",
        "words": f"{where}seed {row['seed']}: {row.get('sentence') or 'it failed'}. ({picture.words})",
        "command": replay_command(row, files, limits),
        "source": f"data:image/jpeg;base64,{base64.b64encode(picture.jpeg).decode()}",
    }


def _timed(trials: int, work: Sequence[Work]) -> str:
    if not trials:
        return ""
    rate = sum(w.rows_per_minute for w in work)
    return (
        f"{trials:,} trials timed, {_many(len(work), 'worker')} on {_many(len({w.host for w in work}), 'host')}, each "
        f"counted over the time in which it was busy: {rate:.1f} rows per minute together. Times of a trial are "
        "without compilation and demonstration; lines reach from the 5th to the 95th percentile, dots are medians."
    )


def _many(n: int, what: str) -> str:
    return f"{n:,} {what}{'' if n == 1 else 's'}"


def _run_words(rows: Sequence[Row]) -> str:
    salt = one_salt(rows)
    salted = (
        f" The trials were drawn with the salt of hash {salt}: `FILE` in a command stands for its file, without "
        "which nobody can draw them again."
    )
    return (
        "Commands on this page are to be run where the sweep was run; they give the same rows with the same versions "
        "(trials that a limit ended: with the limits that `run.json` says, those of the last start of the sweep)."
        f"{salted if salt else ''}"
    )


def _facts_of(rows: Sequence[Row], work: Sequence[Work]) -> dict[str, Any]:
    """What the rows say of how they were made."""
    salt = one_salt(rows)
    names = ("schema", "fidelity", "grasp", "arm", "timestep_s", "clearance_mm")
    called = {"schema": "schemas", "timestep_s": "time step [s]", "clearance_mm": "clearance [mm]"}
    return {
        **{called.get(name, name): sorted({look_up(row, name) for row in rows}) for name in names},
        "seeds": f"{min(r['seed'] for r in rows)} to {max(r['seed'] for r in rows)}",
        "hosts": sorted({w.host for w in work}) or "not known",
        "specifications": f"{len({row.get('spec_hash') for row in rows}):,} by their hash",
        **({"salt": salt} if salt else {}),
    }
