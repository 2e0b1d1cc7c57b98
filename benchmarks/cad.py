"""What `part import` makes of files at its limits, and of files that others drew: sentence, time, memory.

`python benchmarks/cad.py [WORD ...]` makes the files of `cad_cases.py` that have one of the words in their names, or
all, and imports each by the command line in a process of its own; `--clones FOLDER` takes the files of `cad_clones.py`
in clones `FOLDER/OWNER/NAME` instead. Keeps what it finds in `results/cad.csv` and writes `docs/results/cad.md` of all
that is kept. STEP needs the extra `cad`. It fails if an import ends in anything but parts or one sentence, or takes
more than 60 s of the processor or 2 GB.
"""

from __future__ import annotations

import argparse
import csv
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks.cad_cases import CASES
from benchmarks.cad_clones import FILES

ROOT = Path(__file__).parents[1]
KEPT = ROOT / "benchmarks" / "results" / "cad.csv"
PAGE = ROOT / "docs" / "results" / "cad.md"
NEXT = "\n"
LIMIT_S = 60.0
LIMIT_MB = 2000.0
_COMMAND = "import sys; from apo_bench.cli.app import main; sys.exit(main())"
_MEASURE = """
import resource, subprocess, sys
code = subprocess.run(sys.argv[1:]).returncode
used = resource.getrusage(resource.RUSAGE_CHILDREN)
print(used.ru_utime + used.ru_stime, used.ru_maxrss)
sys.exit(code if code >= 0 else 128 - code)
"""
"""In a small process between: the memory of one that starts another counts as that of the other."""


class Became(NamedTuple):
    """What an import ended in."""

    code: int
    said: str
    """The sentence, or what was imported."""
    seconds: float
    """Of the processor."""
    megabytes: float
    """The most of any of its processes."""

    @property
    def is_sound(self) -> bool:
        return self.code in (0, 2) and self.seconds < LIMIT_S and self.megabytes < LIMIT_MB and "\n" not in self.said


def imported(path: Path, *options: str) -> Became:
    """Import one file by the command line."""
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "out"
        err = Path(folder) / "err"
        command = [sys.executable, "-c", _COMMAND, "part", "import", str(path), *options, "--out", f"{folder}/parts"]
        with out.open("wb") as said, err.open("wb") as failed:
            start = [sys.executable, "-S", "-c", _MEASURE, *command]
            done = subprocess.run(start, stdin=subprocess.DEVNULL, stdout=said, stderr=failed, check=False)
        *lines, used = out.read_text(errors="replace").splitlines()
        error = err.read_text(errors="replace").strip()
    seconds, size = (float(word) for word in used.split())
    megabytes = size / (1e6 if sys.platform == "darwin" else 1e3)
    return Became(done.returncode, _sentence(lines, error, path), seconds, megabytes)


def _sentence(lines: list[str], error: str, path: Path) -> str:
    """What was said, without the folder of the file."""
    found = "; ".join(_told(lines))
    said = f"{found}; {error}" if found and error else found or error
    return said.replace(f"{path.parent}/", "").replace("apo-bench: ", "")


def _told(lines: list[str]) -> Iterator[str]:
    """The lines of an import that say what was mended, refused or left without a contact, in short."""
    parts = [line for line in lines if "triangles, watertight" in line]
    if not parts:
        return
    places = next((line.split(": ", 1)[1] for line in lines if "poses.toml" in line), "1 part")
    first = parts[0].split(": ", 1)[1].split(",")[0]
    yield f"imported: {first if len(parts) == 1 else places}"
    yield from dict.fromkeys(line.strip() for line in lines if line.startswith("  mended: "))
    faces = sum(line.startswith("    ") for line in lines)
    refused = sum("NO CONTACT" in line for line in lines)
    yield f"{faces - refused} faces for contacts" + (f", {refused} that cannot make any" if refused else "")
    other = [int(line.split()[2]) for line in lines if line.startswith("  without contact: ") and "neither" in line]
    if other:
        yield f"{sum(other)} free surfaces without contact"
    loss = [line.split("; ", 1)[1] for line in lines if line.startswith("  pieces: ") and "; " in line]
    if len(loss) == 1:
        yield loss[0]
    elif loss:
        yield f"free shapes in {len(loss)} parts, the loss said"


Asked = Iterator[tuple[str, Path, tuple[str, ...]]]


def made(folder: Path, words: Sequence[str]) -> Asked:
    """The files of the first table."""
    for number, (name, case) in enumerate(CASES.items()):
        if is_asked(name, words):
            within = folder / str(number)
            within.mkdir()
            yield name, case.make(within), case.options


def cloned(folder: Path, words: Sequence[str]) -> Asked:
    """The files of others."""
    for each in FILES:
        if is_asked(each.name, words):
            yield each.name, folder / each.repository / each.path, each.options


def is_asked(name: str, words: Sequence[str]) -> bool:
    return not words or any(word in name for word in words)


def row(name: str, became: Became) -> str:
    """Of a table."""
    said = became.said.replace("|", "\\|").replace("<", "&lt;").replace("[", "\\[")
    return f"| {name} | {said} | {became.seconds:.0f} | {became.megabytes:.0f} |"


def page(found: Mapping[str, Became]) -> str:
    """docs/results/cad.md."""
    limits = [row(name, found[name]) for name in CASES if name in found]
    foreign = [each.name for each in FILES if each.name in found]
    parts = sum(found[name].said.startswith("imported") for name in foreign)
    return f"""# CAD files at the limits

Written by `python benchmarks/cad.py`: each file goes through `apo-bench part import` in a process of its own. Seconds
are of one core of the processor; MB is the most memory that any process of the import took. Every import ends in parts
or in one sentence, within 60 s and 2 GB; parts that a file can give are written even where others of it are refused.

## Files made by scripts

| file | what it says | s | MB |
|---|---|---|---|
{NEXT.join(limits)}

## Files that public repositories contain

Tried, not shipped: of {len(foreign)} files {parts} became parts. A flat or round face makes no contact where the convex
pieces that stand for the solid do not have it: beside fillets and free surfaces, mostly.

| file | from, licence | what became of it | s | MB |
|---|---|---|---|---|
{NEXT.join(row(name, found[name]) for name in foreign)}
"""


def kept() -> dict[str, Became]:
    if not KEPT.exists():
        return {}
    with KEPT.open(encoding="utf-8", newline="") as file:
        return {
            name: Became(int(code), said, float(seconds), float(megabytes))
            for name, code, said, seconds, megabytes in csv.reader(file)
        }


def main() -> None:
    asked = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    asked.add_argument("words", nargs="*", help="in the names of the files; default: all")
    asked.add_argument("--clones", type=Path, help="a folder of clones OWNER/NAME")
    given = asked.parse_args()
    sound = True
    with tempfile.TemporaryDirectory() as folder:
        tried = cloned(given.clones, given.words) if given.clones else made(Path(folder), given.words)
        for name, path, options in tried:
            became = imported(path, *options)
            sound = sound and became.is_sound
            print(f"{'' if became.is_sound else 'BROKEN '}{row(name, became)}", flush=True)
            found = {**kept(), name: became}
            with KEPT.open("w", encoding="utf-8", newline="") as file:
                csv.writer(file, lineterminator="\n").writerows([each, *found[each]] for each in sorted(found))
    PAGE.write_text(page(kept()), encoding="utf-8")
    if not sound:
        sys.exit("an import ended in neither parts nor one sentence, or took too much")


if __name__ == "__main__":
    main()
