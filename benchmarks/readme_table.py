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
COLUMNS = ("scenario", "method", "noise", "noise_mm", "human_error_scale", "robot_error")
MEASURED = "megapose-tless"
ROBOT_ERROR = "hand_eye:0.5/0.1"


def conditions(path: Path) -> list[dict[str, str]]:
    """Return the lines of a table of conditions."""
    with path.open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def pool(lines: Sequence[dict[str, str]], method: str, noise: str = "isotropic", robot_error: str = "none") -> Rate:
    """Return the success of a method at 1 mm and 1 degree without human error, over all scenarios that ran."""
    own = [
        line
        for line in lines
        if (line["method"], line["noise"], line["robot_error"]) == (method, noise, robot_error)
        and (float(line["noise_mm"]), float(line["human_error_scale"])) == (1.0, 0.0)
    ]
    return Rate(sum(int(line["successes"]) for line in own), sum(int(line["trials"]) for line in own))


def rows() -> Iterator[tuple[str, str, str]]:
    """Return condition, method and success of each line of the table."""
    lines = conditions(HEADLINE)
    probed = conditions(PROBING)
    plain = "4 tasks, 20 seeds each"
    for words, method in (
        ("poses as observed", "uncorrected"),
        ("with a spiral search", "spiral-search"),
        ("nominal poses, no contacts", "nominal"),
        ("contact-corrected", "contact-robust"),
    ):
        yield plain, f"{words} (`{method}`)", counted(pool(lines, method))
    limits = f"the same, poses of an estimator with outliers (`{MEASURED}`)"
    for words, method in (("poses as observed", "uncorrected"), ("contact-corrected", "contact-robust")):
        yield limits, f"{words} (`{method}`)", counted(pool(lines, method, noise=MEASURED))
    robot = f"2 of the tasks, 20 seeds each, robot error of 0.5 mm, 0.1 degree (`{ROBOT_ERROR}`)"
    for words, method, source in (
        ("contact-corrected", "contact-robust", lines),
        ("with a spiral search", "contact-robust+spiral", lines),
        ("with probing", "contact-robust+probe", probed),
    ):
        yield robot, f"{words} (`{method}`)", counted(pool(source, method, robot_error=ROBOT_ERROR))


def results() -> list[str]:
    """Return the lines of the table in Markdown; a condition is named once."""
    written: list[tuple[str, str, str]] = []
    before = ""
    for condition, method, success in rows():
        written.append(("" if condition == before else condition, method, success))
        before = condition
    return table(("at 1 mm, 1 degree (1 sigma per axis)", "method", "success (95 % interval)"), written)


def in_readme(text: str) -> str:
    """Return the README with the table."""
    before, rest = text.split(BEGIN)
    lines = "\n".join(results())
    return f"{before}{BEGIN}\n{lines}\n\n{END}{rest.split(END)[1]}"


def keep(folder: Path) -> None:
    """Keep the counts of a sweep of benchmarks/probing.toml."""
    found = group(read_judged([folder]), lambda row: tuple(str(row[name]) for name in COLUMNS))
    with PROBING.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow([*COLUMNS, "trials", "successes"])
        for place, own in sorted(found.items()):
            rate = rate_of(own)
            writer.writerow([*place, rate.trials, rate.successes])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path, nargs="?", help="a sweep of benchmarks/probing.toml")
    folder = parser.parse_args().folder
    if folder is not None:
        keep(folder)
    README.write_text(in_readme(README.read_text(encoding="utf-8")), encoding="utf-8")


if __name__ == "__main__":
    main()
