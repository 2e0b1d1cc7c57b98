"""The page of a sweep: who succeeds, where and why not, with every trial behind its cell."""

from __future__ import annotations

import base64
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, final

from apo_bench.records import verdicts
from apo_bench.records.method import knows_truth
from apo_bench.records.replay_command import Files, replay_command
from apo_bench.records.salt import one_salt
from apo_bench.records.settings import RANGE
from apo_bench.report.failures import FailurePicture
from apo_bench.report.figures import gaps as gap
from apo_bench.report.figures import times
from apo_bench.report.figures.figures import Figure, methods_of
from apo_bench.report.page.behind import behind, packed, why
from apo_bench.report.page.document import Section, document
from apo_bench.report.page.markup import Html, joined, prose, tag
from apo_bench.report.page.ran import limits_of, ran
from apo_bench.report.tables import halves
from apo_bench.report.tables.calibration import WORDS as CALIBRATION
from apo_bench.report.tables.calibration import calibration_table
from apo_bench.report.tables.confusion import WORDS as CONFUSION
from apo_bench.report.tables.confusion import confusion_table
from apo_bench.report.tables.effort import WORDS as EFFORT
from apo_bench.report.tables.effort import effort_table
from apo_bench.report.tables.matrix import matrices
from apo_bench.report.tables.paired import WORDS as PAIRED
from apo_bench.report.tables.pairs import pair_table
from apo_bench.report.tables.recognised import WORDS as RECOGNISED
from apo_bench.report.tables.recognised import Recognition, recognition_table
from apo_bench.statistics.calibration import calibrations
from apo_bench.statistics.confusion import Confusion
from apo_bench.statistics.effort import efforts
from apo_bench.statistics.rates import Cell, place_of
from apo_bench.statistics.settings import Setting, at, setting_of
from apo_bench.statistics.summary import Summary

Row = Mapping[str, Any]


@final
@dataclass(frozen=True)
class Found:
    """All that a page shows."""

    name: str
    """Of the folder."""
    verdict: str
    """What is counted as success."""
    rows: Sequence[Row]
    summary: Summary
    grouped: Mapping[Setting, Sequence[Cell]]
    figures: Mapping[str, Figure]
    gaps: Sequence[gap.Gap]
    confusions: Sequence[Confusion]
    recognitions: Sequence[Recognition]
    timing: Sequence[Mapping[str, Any]]
    run: Mapping[str, Any]
    files: Files
    pictures: Sequence[FailurePicture]
    no_pictures: Sequence[str]
    """Why pictures are missing, in sentences."""
    drawn: Mapping[str, Path]
    """PNG files that stand in the page as they are, by name."""
    tables: Sequence[str]
    """Files beside the page, relative to it."""


def report_page(found: Found) -> str:
    """The page, as HTML."""
    numbers = {at(cell): i for i, cell in enumerate(found.summary.cells)}
    pictured = {}
    for k, picture in enumerate(found.pictures):
        place = place_of(picture.row)
        if place in numbers:
            pictured[numbers[place], picture.row["seed"]] = k
    methods = methods_of(found.summary.cells)
    sections = [
        Section("success", "Success", _success(found, numbers)),
        Section("levels", "Success over level", _levels(found)),
        Section("pairs", "Paired differences", _pairs(found)),
        Section("stages", "Where trials failed", _stages(found)),
        Section("pictures", "Some failures", _pictures(found)),
        Section("gaps", "Gap before and after correction", _gaps(found)),
        Section("prediction", "Prediction and physics", _prediction(found)),
        Section(
            "effort", "What it takes", _table(EFFORT, effort_table(efforts(found.rows)).html("No trial was right."))
        ),
        Section("calibration", "Calibration", _calibration(found)),
        Section("recognised", "Recognised contacts", _recognised(found)),
        Section("timing", "Timing", _timing(found)),
        Section("run", "What was run", _ran(found)),
    ]
    values = behind(found.rows, found.summary.cells, found.files, pictured, limits_of(found.run))
    return document(f"Sweep {found.name}", _lead(found), sections, methods, {"behind": packed(values)})


def level_meaning(rows: Sequence[Row]) -> str:
    """What a level is, for the eyes that looked."""
    noises = {row["noise"] for row in rows}
    if noises == {RANGE}:
        return "A level of L is a standard deviation of L mm per ray of the range finder."
    also = "; seen by the range finder (noise `range`), of L mm per ray" if RANGE in noises else ""
    return (
        "A level of L is a standard deviation of L mm and L degrees per axis, times what the noise model makes of it "
        f"in a direction or for a part{also}."
    )


def left_out(rows: Sequence[Row]) -> tuple[int, int]:
    """Demonstrations that were not right themselves, and all."""

    def shown(some: Sequence[Row]) -> int:
        return len({(row["scenario"], row["clearance_mm"], row["seed"], row["careless"]) for row in some})

    return shown([row for row in rows if row["success"] is None]), shown(rows)


def _lead(found: Found) -> Html:
    rows = found.rows
    excluded, shown = left_out(rows)
    fidelity = ", ".join(sorted({str(row.get("fidelity", "full")) for row in rows}))
    tiles = (
        ("trials", f"{len(rows):,}"),
        ("scenarios", len({row["scenario"] for row in rows})),
        ("methods", len({row["method"] for row in rows})),
        ("seeds", f"{len({row['seed'] for row in rows}):,}"),
        ("demonstrations left out", f"{excluded:,} of {shown:,}"),
        ("fidelity", fidelity),
    )
    words = "How often the replay of an observed assembly fits, with and without correction. " + level_meaning(rows)
    boxes = tag("dl", *(tag("div", tag("dt", name), tag("dd", value)) for name, value in tiles), class_="tiles")
    older = verdicts.words(found.verdict)
    return joined([*([tag("p", tag("strong", older), class_="lead")] if older else []), prose(words, "lead"), boxes])


def _success(found: Found, numbers: Mapping[Any, int]) -> Html:
    words = (
        "Success, that the finished assembly is right, with Wilson's 95 % interval and the number of trials; below it, "
        "where it is not the same, how many were also made as demonstrated: each contact when and where it was shown. "
        "A cell opens the trials behind it, each "
        "with the command that runs it again. `oracle` replays the drawn layout, without noise or carelessness; "
        "`none` replays what was seen; neither is told what touches what. A method that refuses or does not converge "
        "counts as failed; success among the trials that were carried out stands below where it differs. "
        "Demonstrations that were not right themselves are left out of every method."
    )
    return joined([prose(words), matrices(found.grouped, numbers)])


def _levels(found: Found) -> Html:
    figure = found.figures.get("success_over_level")
    if figure is None:
        here = sorted({f"{c.level:g}" for c in found.summary.cells if not knows_truth(c.method)})
        what = f"every trial was at level {here[0]}" if len(here) == 1 else "no setting has two levels"
        return tag("p", f"No level varied: {what}, so there is no curve to draw.", class_="none")
    words = (
        "Bands are Wilson's 95 % intervals; methods stand a little apart so that equal rates do not hide each other."
    )
    made = [prose(words), figure.html(), _drawn(found, "success_over_tightness", "Success over tightness")]
    made.append(tag("h3", "Half success, and the area under the curve"))
    if found.summary.half_levels:
        made.append(prose(halves.WORDS))
        made.append(halves.half_table(found.summary.half_levels, found.summary.areas).html(halves.NONE))
        if found.summary.area_differences:
            made.append(halves.difference_table(found.summary.area_differences).html())
    else:
        made.append(tag("p", halves.NONE, class_="none"))
    return joined(made)


def _pairs(found: Found) -> Html:
    if not found.summary.pairs:
        return tag("p", "No two methods share a cell, so there is nothing to pair.", class_="none")
    made = [prose(PAIRED)]
    for reference in dict.fromkeys(p.reference for p in found.summary.pairs):
        figure = found.figures.get(f"difference_to_{reference}")
        if figure is not None:
            made += [tag("h3", f"Against {reference}"), figure.html()]
    return joined([*made, tag("h3", "Every pair of methods"), pair_table(found.summary.pairs).html()])


def _stages(found: Found) -> Html:
    figure = found.figures.get("failure_stages")
    if figure is None:
        return tag("p", "No trial counts, so none failed.", class_="none")
    words = "Shares of the trials of a cell: success, and of failures the stage at which they ended."
    return joined([prose(words), figure.html()])


def _pictures(found: Found) -> Html:
    made: list[Html] = []
    if not found.pictures:
        why_not = "; ".join(found.no_pictures) or "None was asked for, or no trial that was carried out failed."
        return tag("p", f"No picture: {why_not}", class_="none")
    for k, one in enumerate(found.pictures):
        place = place_of(one.row)
        where = "" if place is None else f"{setting_of(place).title()}, level {place.level:g}"
        title = tag("strong", f"{one.row['method']}: {why(one.row)}")
        told = f"{where}, seed {one.row['seed']}: {one.row.get('sentence') or ''}. ({one.words})"
        command = replay_command(one.row, found.files, limits_of(found.run))
        button = tag("button", "copy", type="button", class_="copy", data_command=command)
        image = tag("img", src=f"data:image/jpeg;base64,{base64.b64encode(one.jpeg).decode()}", alt=told)
        caption = tag("figcaption", title, " ", told, tag("div", button, tag("code", command), class_="command"))
        made.append(tag("figure", image, caption, id=f"picture-{k}"))
    missed = [tag("p", f"Not drawn: {'; '.join(found.no_pictures)}", class_="none")] if found.no_pictures else []
    words = "A sample: kinds of failure by turns, the most frequent first; the same rows give the same sample."
    return joined([prose(words), tag("div", *made, class_="pictures"), *missed])


def _gaps(found: Found) -> Html:
    figure = found.figures.get("gap_before_and_after")
    if figure is None:
        return tag("p", "No method that corrects had a plan, so there is no gap to compare.", class_="none")
    return joined([prose(gap.WORDS), figure.html(), gap.gap_table(found.gaps).html()])


def _prediction(found: Found) -> Html:
    figure = found.figures.get("prediction")
    none = tag("p", "No trial was executed, so nothing was predicted.", class_="none")
    drawn = none if figure is None else figure.html()
    return joined([prose(CONFUSION), drawn, confusion_table(found.confusions).html()])


def _calibration(found: Found) -> Html:
    return _table(CALIBRATION, calibration_table(calibrations(found.rows)).html("No method was tried."))


def _recognised(found: Found) -> Html:
    if not found.recognitions:
        return tag("p", "No method was told contacts that were recognised: all were given.", class_="none")
    table = recognition_table(found.recognitions).html()
    return joined([prose(RECOGNISED), _drawn(found, "recognised", "Recognised contacts over level"), table])


def _timing(found: Found) -> Html:
    if not found.timing:
        return tag("p", "There is no timing.jsonl beside the rows, so times are not known.", class_="none")
    known, done = times.times(found.timing), times.work(found.timing)
    rate = sum(w.rows_per_minute for w in done)
    crew = f"{_many(len(done), 'worker')} on {_many(len({w.host for w in done}), 'host')}"
    words = (
        f"{len(found.timing):,} trials timed, {crew}, each counted over the time in which it was busy: {rate:.1f} rows "
        "per minute together. Times of a trial are without compilation and demonstration; lines reach from the 5th to "
        "the 95th percentile, dots are medians."
    )
    figure = found.figures["timing"].html() if "timing" in found.figures else ""
    return joined([prose(words), figure, times.time_table(known).html(), times.work_table(done).html()])


def _many(n: int, what: str) -> str:
    return f"{n} {what}{'' if n == 1 else 's'}"


def _ran(found: Found) -> Html:
    rows = found.rows
    said = {
        "schemas": sorted({str(row["schema"]) for row in rows}),
        "fidelity": sorted({str(row.get("fidelity", "full")) for row in rows}),
        "grasp": sorted({str(row["grasp"]) for row in rows}),
        "arm": sorted({str(row.get("arm", "six_axis")) for row in rows}),
        "time step [s]": sorted({row.get("timestep_s", 0.001) for row in rows}),
        "clearance [mm]": sorted({row["clearance_mm"] for row in rows}),
        "seeds": f"{min(r['seed'] for r in rows)} to {max(r['seed'] for r in rows)}",
        "hosts": sorted({str(line.get("host", "")) for line in found.timing}) or "not known",
        "specifications": f"{len({row.get('spec_hash') for row in rows}):,} by their hash",
    }
    beside = tag("ul", *(tag("li", tag("a", name, href=name)) for name in found.tables))
    words = (
        "Commands on this page are to be run where the sweep was run; they give the same rows with the same versions "
        "(trials that a limit ended: with the limits that `run.json` says, those of the last start of the sweep)."
    )
    if drawn := one_salt(rows):
        said["salt"] = drawn
        words += (
            f" The trials were drawn with the salt of hash {drawn}: `FILE` in a command stands for its file, without "
            "which nobody can draw them again."
        )
    return joined([prose(words), ran(found.run, said), tag("h3", "Beside this page"), beside])


def _table(words: str, table: Html) -> Html:
    return joined([prose(words), table])


def _drawn(found: Found, name: str, title: str) -> Html:
    path = found.drawn.get(name)
    if path is None:
        return Html("")
    source = f"data:image/png;base64,{base64.b64encode(path.read_bytes()).decode()}"
    return tag("figure", tag("figcaption", title), tag("img", src=source, alt=title), class_="drawn")
