"""The HTML page of a sweep's report: its sections, pictures and commands."""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from apo_bench.benchmark.analysis import ConditionResult, get_condition, group_by_setting, list_settings
from apo_bench.benchmark.report.failure_choice import FailurePicture
from apo_bench.benchmark.report.figures.sheet import Figure
from apo_bench.benchmark.report.page.matrix import make_matrix, pack_trials
from apo_bench.benchmark.report.page.page import Section, embed_data, render_page
from apo_bench.benchmark.report.run_facts import list_run_facts
from apo_bench.benchmark.report.tables.table import Table
from apo_bench.benchmark.report.trial_text import describe_failure
from apo_bench.io import format_count
from apo_bench.records.run.replay_command import format_replay_command
from apo_bench.records.run.run_file import list_scenario_files, read_limits
from apo_bench.records.run.trials import Trials

_SUCCESS = (
    "A noise level of L is a standard deviation of L mm and L degrees per axis, which the noise model scales for a "
    "direction or a part; of the depth camera it is L mm per ray. Success means that the finished assembly is right, "
    "with Wilson's 95 % interval and the number of trials. Below it, where it differs, stand the trials that were also "
    "made as demonstrated: each contact when and where it was shown. A cell opens its trials, each with the command "
    "that runs it again. `oracle` replays the true poses, without noise or human error; `uncorrected` replays the "
    "observed poses. A method that abstains or does not converge counts as failed; success among the executed trials "
    "stands below where it differs. No method counts demonstrations that were not right themselves."
)
_RUN = (
    "Run the commands of this page where the sweep ran; they give the same records with the same versions. For trials "
    "that a limit ended they use the limits of `run.json`. For trials drawn with a secret seed, `FILE` stands for its "
    "file."
)
_BANDS = "Bands are 95 % intervals; methods stand a little apart so that equal rates do not hide each other."


class Contents(NamedTuple):
    """Everything that a page shows."""

    name: str
    """Name of the folder."""
    answer: str
    """The sentences at the top, with code in backquotes."""
    trials: Trials
    results: Sequence[ConditionResult]
    figures: Mapping[str, Figure]
    tables: Mapping[str, Table]
    run: Mapping[str, Any]
    """The content of `run.json`."""
    pictures: Sequence[FailurePicture]
    no_pictures: Sequence[str]
    """Sentences on why pictures are missing."""
    beside: Sequence[str]
    """Paths of further files, relative to the page."""


def render_report(c: Contents) -> str:
    """Return the page as HTML."""
    numbers = {result.condition: i for i, result in enumerate(c.results)}
    # condition and seed of each picture
    shown = [(get_condition(picture.row), picture.row["seed"]) for picture in c.pictures]
    pictured = {f"{numbers[condition]}:{seed}": k for k, (condition, seed) in enumerate(shown) if condition in numbers}
    by_setting = group_by_setting(list_settings(c.results), c.results)
    matrices = [make_matrix(setting, own, numbers) for setting, own in by_setting.items()]
    differences = [name for name in c.figures if name.startswith("difference_to_")]
    over = ("success_over_noise_level", "success_over_tightness", "success_over_reobservations")
    half = ("folded", ("Noise level at half of the success", c.tables["half_levels"]))
    sections = [
        Section("success", "Success", [("note", _SUCCESS), *(("matrix", each) for each in matrices)], open=True),
        Section(
            "levels", "Success over noise level", [*_list_shown_figures(c, over), ("text", _BANDS), half], open=True
        ),
        Section("pairs", "Paired differences", _list_shown_figures(c, differences, "pairs")),
        Section("stages", "Stages of failures", _list_shown_figures(c, ("failure_stages",))),
        Section("pictures", "Failures", _make_picture_section(c)),
        Section("gaps", "Gap before and after correction", _list_shown_figures(c, ("gap_before_and_after",), "gaps")),
        Section("prediction", "Prediction and physics", _list_shown_figures(c, ("prediction",), "confusion")),
        Section("probing", "Probing", _list_shown_figures(c, (), "probing")),
        Section("effort", "Effort", _list_shown_figures(c, (), "effort")),
        Section("calibration", "Calibration", _list_shown_figures(c, (), "calibration")),
        Section("detected", "Detected contacts", _list_shown_figures(c, ("detected",), "detected")),
        Section("timing", "Timing", _list_shown_figures(c, ("timing",), "times", "work")),
        Section("run", "Run", _make_run_section(c)),
    ]
    title = c.name if "sweep" in c.name.lower() else f"Sweep {c.name}"
    packed = pack_trials(c.trials, list_scenario_files(c.run), read_limits(c.run), pictured)
    return render_page(title, c.answer, [_describe_scope(c.trials)], sections, packed)


def _list_shown_figures(c: Contents, figures: Sequence[str], *tables: str) -> list[tuple[str, Any]]:
    """Return the blocks of a section: existing figures, then tables."""
    drawn = [("figure", c.figures[name]) for name in figures if name in c.figures]
    return [*drawn, *(("table", c.tables[name]) for name in tables)]


def _make_picture_section(c: Contents) -> list[tuple[str, Any]]:
    """Return the blocks of the section on failures: pictures, and why others are missing."""
    missing = "; ".join(c.no_pictures) or "None was asked for, or no trial that was carried out failed."
    if not c.pictures:
        return [("missing", f"No picture: {missing}")]
    blocks: list[tuple[str, Any]] = [("picture", _make_picture(c, k)) for k in range(len(c.pictures))]
    return [*blocks, *[("missing", f"Not drawn: {missing}")] * bool(c.no_pictures)]


def _make_picture(c: Contents, number: int) -> dict[str, str]:
    """Return title, description, command and image of a picture for the template."""
    row, jpeg, words = c.pictures[number]
    condition = get_condition(row)
    where = "" if condition is None else f"{condition.title}, noise {condition.noise_mm:g}, "
    return {
        "name": f"picture-{number}",
        "title": f"{row['method']}: {describe_failure(row)}.",
        "words": f"{where}seed {row['seed']}: {row.get('sentence') or 'it failed'}. ({words})",
        "command": format_replay_command(row, list_scenario_files(c.run), read_limits(c.run)),
        "source": embed_data(jpeg, "image/jpeg"),
    }


def _make_run_section(c: Contents) -> list[tuple[str, Any]]:
    """Return the blocks of the section on the run: command, tables of settings, and links to further files."""
    hosts = {line["host"] for line in c.tables["work"].items}
    command = [("command", c.run["command"])] if "command" in c.run else []
    none = "There is no run.json beside the rows, so versions and command are not known."
    blocks: list[tuple[str, Any]] = [("text", _RUN), *command, *[("missing", none)] * (not c.run)]
    facts = list_run_facts(c.run, c.trials, hosts)
    return [*blocks, *(("folded", fact) for fact in facts.items()), ("links", c.beside)]


def _describe_scope(trials: Trials) -> str:
    """Return a sentence that counts trials, scenarios, methods and seeds, and the trials that were left out."""
    names = ("scenario", "clearance_mm", "seed", "human_error_scale")
    tried = len(trials.groups(names).keys)
    excluded = len(trials.where(np.isnan(trials.number("success"))).groups(names).keys)
    scenarios, methods, seeds = (format_count(len(trials.distinct(x)), x) for x in ("scenario", "method", "seed"))
    fidelity = ", ".join(sorted(trials.distinct("fidelity")))
    left_out = f"{excluded:,} of {format_count(tried, 'demonstration')} not right and left out."
    return (
        f"{format_count(len(trials), 'trial')} of {scenarios}, {methods} and {seeds}, fidelity {fidelity}. {left_out}"
    )
