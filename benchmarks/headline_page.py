"""The page of the headline: the first look, all rates, where it breaks, and what was run."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from apo_bench.benchmark.analysis import Cell, Paired
from apo_bench.benchmark.sweeps.grid import described, load_all
from apo_bench.benchmark.sweeps.sweep_file import read_sweep
from apo_bench.records import SETTINGS, TrialConfig
from benchmarks.headline_look import TOLD_LEVEL, Look, block, robot_scenarios
from benchmarks.headline_tables import differing, rates, together, widths

GRID = Path(__file__).with_name("headline.toml")
METHODS = ("uncorrected", "spiral-search", "snap", "nominal", "paper", "contact", "contact-robust")
COMPARED = ("contact", "contact-robust")
"""With `paper`, seed by seed."""
ROBOT_METHODS = {"oracle": 0.0, "contact-robust": TOLD_LEVEL, "contact-robust+spiral": TOLD_LEVEL}
"""Those that were run with errors of the robot, and their level."""
BY_CONSTRUCTION = (
    "`none` is 0 here by construction: castle 2 (in pocket_table cube 2) is shown 1.5 to 4 mm off, and the play of the "
    "fits is 0.25 mm."
)
OUTLIERS = (
    f"Level {TOLD_LEVEL:g}, careful humans: `outliers` makes 10 % of the errors ten times as large and misses 2 % of "
    "the operations; `megapose-tless` is what was measured of a pose estimator: it misses 26 % of the parts and is far "
    "off in 24 % of the others ([noise models](../reference/noise-models.md)). Most methods refuse to correct what was "
    "not seen."
)
ROBOT = (
    f"Level {TOLD_LEVEL:g}, careful humans; a [robot error](../guide/arm.md#what-is-wrong-with-the-robot-itself) is "
    "drawn anew for every trial, with standard deviations in mm and degrees. Contacts repair the eye's error, not the "
    "robot's: `oracle` replays the truth and meets no noise, and fails as well."
)
OLDER = " **`benchmarks/headline.toml` asks for other trials by now; these rows are older.**"


def page(look: Look, pairs: Sequence[Paired], ran: Mapping[str, Any], agreement: Sequence[str]) -> list[str]:
    """The first look, all rates, and what was run."""
    least = min(cell.trials for cell in look.cells)
    plain = [c for c in look.cells if c.noise == TrialConfig.noise and c.robot_error == TrialConfig.robot_error]
    held = sorted((c for c in plain if c.method in METHODS), key=in_order)
    broken = sorted((c for c in look.cells if c.noise != TrialConfig.noise), key=in_order)
    robot = sorted((c for c in look.cells if of_robot(c, robot_scenarios(look.cells))), key=by_error)
    other = [c for c in plain if c.method not in (*METHODS, *ROBOT_METHODS)]
    oracle = [c for c in plain if c.method == "oracle"]
    return [
        "# The headline",
        "",
        *block(look, "../pictures", None),
        "",
        "## All rates",
        "",
        "Success in percent: the finished assembly is right ([the judge](../how/judge.md)); in brackets: also built as "
        "it was demonstrated, where that is less. Columns are levels: L is a standard deviation of L mm and L degrees "
        "per axis. [Methods](../reference/methods.md): `none` replays what was seen, `search` also feels for the "
        "holes, `paper` corrects as the paper does, `contact` as [this project](../how/contact.md) does; all with the "
        f"same seeds. {widths(least)} `benchmarks/results/headline/table.csv` has the intervals of all cells.",
        "",
        "### Careful humans",
        "",
        "They put parts where they belong.",
        "",
        *rates([c for c in held if c.human_error_scale == 0.0], ("scenario", "method"), named, lambda c: c.noise_mm),
        "",
        "### Careless humans",
        "",
        f"They put parts wrong and adjust them later, as in the paper. {BY_CONSTRUCTION} What stands wrong to each "
        "other before anything is inserted cannot be searched away.",
        "",
        *rates([c for c in held if c.human_error_scale == 1.0], ("scenario", "method"), named, lambda c: c.noise_mm),
        "",
        *section("## Where it breaks: outliers", OUTLIERS, ("noise", "method"), broken),
        *section("## Where it breaks: the robot's own error", ROBOT, ("robot error", "method"), robot),
        "## Other methods at level 2, careless humans",
        "",
        *rates(other, ("method",), lambda c: (f"`{c.method}`",), lambda c: c.scenario),
        "",
        "Without any error, `oracle`, which replays the drawn layout, is right in "
        + ", ".join(f"{c.successes} of {c.trials} ({c.scenario})" for c in oracle)
        + ".",
        "",
        "## Pairs",
        "",
        *differing(pairs, COMPARED),
        "",
        "## What was run",
        "",
        what_ran(ran, least),
        "",
        *agreement,
    ]


def what_ran(ran: Mapping[str, Any], least: int) -> str:
    """Command, size, time and versions; and whether the sweep file asks for something else by now."""
    versions = ran["versions"]
    return (
        f"Written by `python benchmarks/headline.py` from the rows of `{ran['command']}`: {ran['rows']} trials, "
        f"{ran['replays']} replays, at least {least} trials in each cell, friction grasp, 0.25 mm clearance per side, "
        f"fidelity `{ran['grids'][0]['fidelity']}`; {ran['simulated_hours']} hours simulated or passed over in "
        f"{ran['worker_hours'] / ran['workers']:.2f} hours by {ran['workers']} process(es) on two cores, which did "
        f"other work now and then. MuJoCo {versions['mujoco']}, mink {versions['mink']}, NumPy "
        f"{versions['numpy']}, Python {ran['python']}; everything else in `benchmarks/results/headline/run.json`, rows "
        f"(without the poses reached) in `rows.jsonl.xz` beside it.{'' if up_to_date(ran) else OLDER}"
    )


def up_to_date(ran: Mapping[str, Any]) -> bool:
    """Whether rows are those of the sweep file as it is now."""
    first = ran["grids"][0]
    grids = read_sweep(GRID, {"trials": first["trials"], "fidelity": first["fidelity"]})
    # in sweeps that are older than these settings nothing abstained or felt
    usual = {
        SETTINGS[name].axis: [SETTINGS[name].default]
        for name in ("ft_sensor", "assumed_robot_error", "min_predicted_success")
    }
    kept = [{**usual, **grid} for grid in ran["grids"]]
    return described(grids, load_all(grids)) == kept


def section(title: str, said: str, heads: tuple[str, str], cells: Sequence[Cell]) -> list[str]:
    """A table over noises or robot errors; nothing where none was run."""

    def row(cell: Cell) -> tuple[str, ...]:
        return f"`{cell.noise if heads[0] == 'noise' else cell.robot_error}`", f"`{cell.method}`"

    return [title, "", said, "", *together(cells, heads, row), ""] if cells else []


def in_order(cell: Cell) -> tuple[Any, ...]:
    """Humans, scenarios or noises, methods from what was seen to what is corrected, levels."""
    return (
        cell.human_error_scale,
        cell.noise,
        cell.scenario,
        (*METHODS, cell.method).index(cell.method),
        cell.noise_mm,
    )


def by_error(cell: Cell) -> tuple[Any, ...]:
    """Errors from none to the largest, then methods."""
    return cell.robot_error != TrialConfig.robot_error, cell.robot_error, [*ROBOT_METHODS].index(cell.method)


def of_robot(cell: Cell, scenarios: Sequence[str]) -> bool:
    """Whether a cell has an error of the robot, or is the same without one."""
    same = cell.scenario in scenarios and cell.noise == TrialConfig.noise and cell.human_error_scale == 0.0
    return same and ROBOT_METHODS.get(cell.method) == cell.noise_mm


def named(cell: Cell) -> tuple[str, ...]:
    return cell.scenario, f"`{cell.method}`"
