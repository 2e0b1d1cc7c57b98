"""Write the table of results in README: `python -m benchmarks.readme_table [FOLDER]`.

The counts are those of benchmarks/results/headline/table.csv and benchmarks/results/probing.csv. With the folder of a
sweep of benchmarks/probing.toml the latter is written first.
"""

from __future__ import annotations

import argparse
import csv
from collections.abc import Iterator, Sequence
from pathlib import Path

from apo_bench.benchmark.analysis import Rate
from benchmarks.rates_by_condition import counted, group, rate_of, read_judged, table

ROOT = Path(__file__).resolve().parents[1]
README = ROOT / "README.md"
HEADLINE = ROOT / "benchmarks" / "results" / "headline" / "table.csv"
PROBING = ROOT / "benchmarks" / "results" / "probing.csv"
BEGIN = "<!-- written by benchmarks/readme_table.py -->\n"
END = "<!-- until here: results -->\n"
BEGIN_SUMMARY = "<!-- written by benchmarks/readme_table.py: summary -->\n"
END_SUMMARY = "<!-- until here: summary -->\n"
COLUMNS = ("scenario", "method", "noise", "noise_mm", "human_error_scale", "robot_error")
MEASURED = "megapose-tless"
ROBOT_ERROR = "hand_eye:0.5/0.1"


def conditions(path: Path) -> list[dict[str, str]]:
    """Return the lines of a table of conditions."""
    with path.open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def pool(
    lines: Sequence[dict[str, str]],
    method: str,
    noise: str = "isotropic",
    robot_error: str = "none",
    counted: str = "successes",
) -> Rate:
    """Return the rate of a method at 1 mm and 1 degree without human error, over all scenarios that ran.

    Args:
        counted: The column of the counts: `successes`, or `as_demonstrated`, successes built as the human did.
    """
    own = [
        line
        for line in lines
        if (line["method"], line["noise"], line["robot_error"]) == (method, noise, robot_error)
        and (float(line["noise_mm"]), float(line["human_error_scale"])) == (1.0, 0.0)
    ]
    return Rate(sum(int(line[counted]) for line in own), sum(int(line["trials"]) for line in own))


def rows() -> Iterator[tuple[str, str, str, str]]:
    """Return condition, method, success and success as demonstrated of each line of the table."""
    lines = conditions(HEADLINE)
    probed = conditions(PROBING)
    plain = "4 tasks, 20 seeds each"
    for words, method in (
        ("poses as observed", "uncorrected"),
        ("with a spiral search", "spiral-search"),
        ("nominal poses, no contacts", "nominal"),
        ("contact-corrected", "contact-robust"),
    ):
        yield plain, f"{words} (`{method}`)", *rates(lines, method)
    limits = f"the same, poses of an estimator with outliers (`{MEASURED}`)"
    for words, method in (("poses as observed", "uncorrected"), ("contact-corrected", "contact-robust")):
        yield limits, f"{words} (`{method}`)", *rates(lines, method, noise=MEASURED)
    robot = f"2 of the tasks, 20 seeds each, robot error of 0.5 mm, 0.1 degree (`{ROBOT_ERROR}`)"
    for words, method, source in (
        ("contact-corrected", "contact-robust", lines),
        ("with a spiral search", "contact-robust+spiral", lines),
        ("with probing", "contact-robust+probe", probed),
    ):
        yield robot, f"{words} (`{method}`)", *rates(source, method, robot_error=ROBOT_ERROR)


def rates(lines: Sequence[dict[str, str]], method: str, **condition: str) -> tuple[str, str]:
    """Return the success with its interval, and the number of successes built as demonstrated."""
    demonstrated = pool(lines, method, counted="as_demonstrated", **condition)
    return counted(pool(lines, method, **condition)), str(demonstrated.successes)


def summarise() -> str:
    """Return the result and its limits in two sentences."""
    lines = conditions(HEADLINE)
    found = (
        pool(lines, "uncorrected"),
        pool(lines, "contact-robust"),
        pool(lines, "contact-robust", noise=MEASURED),
        pool(lines, "contact-robust", robot_error=ROBOT_ERROR),
        pool(conditions(PROBING), "contact-robust+probe", robot_error=ROBOT_ERROR),
    )
    uncorrected, corrected, measured, robot, probed = (f"**{rate.successes} of {rate.trials}**" for rate in found)
    return (
        f"In simulation, with pose noise of 1 mm and 1 degree, the replay succeeds in {uncorrected} trials; corrected "
        f"by contacts, in {corrected}. It breaks with the gross errors of a measured pose estimator ({measured}), and "
        f"with a hand-eye error of 0.5 mm ({robot}; if the robot probes, {probed})."
    )


def results() -> list[str]:
    """Return the lines of the table in Markdown; a condition is named once."""
    written: list[tuple[str, ...]] = []
    before = ""
    for condition, *cells in rows():
        written.append(("" if condition == before else condition, *cells))
        before = condition
    return table(
        ("at 1 mm, 1 degree (1 sigma per axis)", "method", "success (95 % interval)", "as demonstrated"), written
    )


def in_readme(text: str) -> str:
    """Return the README with the summary and the table."""
    for begin, content, end in ((BEGIN_SUMMARY, summarise(), END_SUMMARY), (BEGIN, "\n".join(results()), END)):
        before, rest = text.split(begin)
        text = f"{before}{begin}{content}\n{end}{rest.split(end)[1]}"
    return text


def keep(folder: Path) -> None:
    """Keep the counts of a sweep of benchmarks/probing.toml."""
    found = group(read_judged([folder]), lambda row: tuple(str(row[name]) for name in COLUMNS))
    with PROBING.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow([*COLUMNS, "trials", "successes", "as_demonstrated"])
        for place, own in sorted(found.items()):
            rate = rate_of(own)
            writer.writerow([*place, rate.trials, rate.successes, sum(bool(row["as_demonstrated"]) for row in own)])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path, nargs="?", help="a sweep of benchmarks/probing.toml")
    folder = parser.parse_args().folder
    if folder is not None:
        keep(folder)
    README.write_text(in_readme(README.read_text(encoding="utf-8")), encoding="utf-8")


if __name__ == "__main__":
    main()
