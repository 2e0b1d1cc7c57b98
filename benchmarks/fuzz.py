"""What strangers' files do to the command line: valid files of every kind, made wrong, thousands of times.

    python -m benchmarks.fuzz [--cases 10000] [--seed 0] [--workers 1] [--write [FILE]] [--case N]

Every case draws a kind of file, changes one file of it in one to four places (bytes, tokens or structure, see
`fuzz_mutate.py`) or puts something in its place that is no file, and runs one command that reads it:
`apo_bench.cli.app.main`, in a fork of this process, in a folder of its own. It must end with exit code 0, 1 or 2,
without a traceback, in 10 s of processor time and 1 GB of memory, and say one sentence at most that a terminal only
shows. `--case N` runs one case again and shows it; `--write` writes the counts, to `results/fuzz.json`. Case i is
drawn from `default_rng([seed, i])`.
"""

from __future__ import annotations

import argparse
import gc
import json
import os
import platform
import re
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import traceback
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from apo_bench import __version__
from apo_bench.cli import app as cli
from apo_bench.errors import InputError
from benchmarks.fuzz_files import Kind, kinds
from benchmarks.fuzz_mutate import RAN, mutated

RESULT = Path(__file__).parent / "results" / "fuzz.json"
LONGEST_S, LARGEST_MB, PATIENCE_S = 10, 1000, 60
LONGEST_SENTENCE = 2000
SPECIAL = 0.03
"""How often something that is no file stands in the place of one."""
CONTROL = re.compile("[\x00-\x08\x0b-\x1f\x7f-\x9f\u200e\u200f\u202a-\u202e\u2066-\u2069]")
FINE = ("exit code 0", "exit code 1", "exit code 2")


class Ended(NamedTuple):
    """One case."""

    case: int
    kind: str
    level: str
    arguments: Sequence[str]
    ending: str
    cpu_s: float
    mb: float
    said: str


def main() -> int:
    parser = argparse.ArgumentParser()
    parser.add_argument("--cases", type=int, default=10_000)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--workers", type=int, default=1)
    parser.add_argument("--case", type=int)
    parser.add_argument("--write", type=Path, nargs="?", const=RESULT)
    asked = parser.parse_args()
    if asked.case is not None:
        with tempfile.TemporaryDirectory() as work:
            print(run_case(prepared(Path(work)), asked.seed, asked.case, Path(work), show=True))
        return 0
    began = time.perf_counter()
    found = fuzz(asked.cases, asked.seed, asked.workers)
    for line in lines(found):
        print(line)
    if asked.write:
        asked.write.write_text(json.dumps(summary(found, asked.seed, time.perf_counter() - began), indent=1) + "\n")
    return int(any(case.ending not in FINE for case in found))


def fuzz(cases: int, seed: int, workers: int = 1) -> list[Ended]:
    """Run cases 0, 1, ..., every worker its share."""
    with tempfile.TemporaryDirectory() as name:
        work = Path(name)
        made = prepared(work)
        sheets = [work / f"sheet{w}" for w in range(workers)]
        children = []
        for w, sheet in enumerate(sheets):
            if child := os.fork():
                children.append(child)
                continue
            with sheet.open("w", buffering=1) as out:
                for case in range(w, cases, workers):
                    out.write(json.dumps(run_case(made, seed, case, work)) + "\n")
            os._exit(0)
        for child in children:
            os.waitpid(child, 0)
        found = [Ended(*json.loads(line)) for sheet in sheets for line in sheet.read_text().splitlines()]
    if len(found) != cases:
        raise RuntimeError(f"{cases - len(found)} cases are missing")
    return sorted(found)


def prepared(work: Path) -> Mapping[str, Kind]:
    """Valid files, each read once here, so that a fork has what it needs imported."""
    with open(os.devnull, "w") as nowhere:
        stdout, sys.stdout = sys.stdout, nowhere
        try:
            made = kinds(work)
            for kind in made.values():
                place = _laid_out(kind, work / "valid")
                for arguments in {tuple(command): None for command in kind.commands}:
                    if (code := _within(place, arguments)) != _expected(arguments):
                        raise RuntimeError(f"{arguments} ended with exit code {code}")
        finally:
            sys.stdout = stdout
    gc.freeze()
    return made


def _expected(arguments: Sequence[str]) -> int:
    """The sweep is read and refused, as its folder is a file: nothing is to be run."""
    return 2 if arguments[0] == "sweep" else 0


def run_case(made: Mapping[str, Kind], seed: int, case: int, work: Path, *, show: bool = False) -> Ended:
    """Draw a case, run it in a fork, and say how it ended."""
    rng = np.random.default_rng([seed, case])
    weights = np.array([kind.weight for kind in made.values()], dtype=float)
    name = list(made)[int(rng.choice(len(made), p=weights / weights.sum()))]
    kind = made[name]
    place = _laid_out(kind, work / f"case{case}")
    path = place / kind.changed[int(rng.integers(len(kind.changed)))]
    if rng.random() < SPECIAL:
        level = _special(path, rng)
    else:
        level, raw = mutated(path.read_bytes(), path.suffix, rng)
        path.write_bytes(raw)
    arguments = kind.commands[int(rng.integers(len(kind.commands)))]
    if show:
        print(f"{name}, {level}, {path.name}: apo-bench {' '.join(arguments)}")
        print(path.read_bytes()[:4000].decode(errors="replace") if path.is_file() else level)
    ending, cpu_s, mb, said = _forked(place, arguments)
    if show:
        print(said)
    shutil.rmtree(place)
    return Ended(case, name, level, arguments, ending, cpu_s, mb, said if ending not in FINE else "")


def _laid_out(kind: Kind, place: Path) -> Path:
    for name, raw in kind.files.items():
        (place / name).parent.mkdir(parents=True, exist_ok=True)
        (place / name).write_bytes(raw)
    return place


def _special(path: Path, rng: np.random.Generator) -> str:
    """Something else in the place of a file."""
    path.unlink()
    what = ("pipe", "folder", "nothing", "device", "loop", "sparse", "empty", "deep")[int(rng.integers(8))]
    if what == "pipe":
        os.mkfifo(path)
    elif what == "folder":
        path.mkdir()
    elif what == "device":
        path.symlink_to("/dev/zero")
    elif what == "loop":
        path.symlink_to(path)
    elif what == "sparse":
        with path.open("wb") as file:
            file.truncate(10**11)
    elif what == "empty":
        path.touch()
    elif what == "deep":
        path.write_bytes(bytes(rng.choice([b"[", b"{", b"<a>", b'{"a":', b"a.", b"[[a]]\n"])) * 100_000)
    return what


def _forked(place: Path, arguments: Sequence[str]) -> tuple[str, float, float, str]:
    """Ending, processor time [s], memory [MB] and what was said, of one command."""
    with tempfile.TemporaryFile() as out, tempfile.TemporaryFile() as err:
        child = os.fork()
        if not child:
            _become(place, arguments, out.fileno(), err.fileno())
        until, status = time.perf_counter() + PATIENCE_S, None
        while status is None:
            found, state, used = os.wait4(child, os.WNOHANG)
            if found:
                status = state
            elif time.perf_counter() > until:
                os.kill(child, signal.SIGKILL)
                until = np.inf
            else:
                time.sleep(0.002)
        said, printed = ((file.seek(0), file.read(1_000_000).decode(errors="replace"))[1] for file in (err, out))
    if arguments[0] not in ("report", "compare"):
        said = said.replace(f"{RAN}\n", "")
    cpu_s, mb = used.ru_utime + used.ru_stime, used.ru_maxrss / 1e3
    return _ending(status, cpu_s, mb, until == np.inf, printed, said), round(cpu_s, 2), round(mb), said[-3000:]


def _ending(status: int, cpu_s: float, mb: float, waited: bool, printed: str, said: str) -> str:
    if waited or cpu_s > LONGEST_S:
        return f"longer than {LONGEST_S} s"
    if os.WIFSIGNALED(status):
        return f"signal {os.WTERMSIG(status)}"
    if "Traceback (most recent call last)" in said or "recursion depth" in said:
        return "traceback"
    if RAN in said:
        return RAN
    if mb > LARGEST_MB:
        return f"more than {LARGEST_MB} MB"
    if (code := os.WEXITSTATUS(status)) not in (0, 1, 2):
        return f"exit code {code}"
    if CONTROL.search(printed) or CONTROL.search(said):
        return "control characters"
    if said.count("\n") > 1 or len(said) > LONGEST_SENTENCE or (code == 2 and not said.startswith("apo-bench: ")):
        return "not one sentence"
    return f"exit code {code}"


def _become(place: Path, arguments: Sequence[str], out: int, err: int) -> None:
    """Run the command here, as its own process would, and end."""
    code = 1
    try:
        resource.setrlimit(resource.RLIMIT_CPU, (LONGEST_S + 5, LONGEST_S + 10))
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
        resource.setrlimit(resource.RLIMIT_AS, (8 * 10**9, 8 * 10**9))
        for number, file in ((0, os.open(os.devnull, os.O_RDONLY)), (1, out), (2, err)):
            os.dup2(file, number)
        sys.stdout = open(1, "w", encoding="utf-8", closefd=False)  # noqa: SIM115
        sys.stderr = open(2, "w", encoding="utf-8", errors="backslashreplace", closefd=False)  # noqa: SIM115
        code = _within(place, arguments)
        sys.stdout.flush()
    except BaseException:
        traceback.print_exc()
    finally:
        sys.stderr.flush()
        os._exit(code)


def _within(place: Path, arguments: Sequence[str]) -> int:
    """The exit code of a command in a folder."""
    before = Path.cwd()
    os.chdir(place)
    try:
        return _read_plan(arguments[1]) if arguments[0] == "read-plan" else cli.main(list(arguments))
    finally:
        os.chdir(before)


def _read_plan(name: str) -> int:
    from apo_bench.files.json_reading import read_plan

    try:
        read_plan(name)
    except InputError as error:
        return cli._complain(str(error), cli.WRONG_REQUEST)
    return 0


def lines(found: Sequence[Ended]) -> list[str]:
    """Counts by kind and ending, and every case that ended as none should."""
    counts = Counter((case.kind, case.ending) for case in found)
    endings = [*FINE, *sorted({case.ending for case in found} - set(FINE))]
    table = [f"{'':24}" + "".join(f"{ending:>20}" for ending in endings)]
    for kind in sorted({case.kind for case in found}):
        table.append(f"{kind:24}" + "".join(f"{counts[kind, ending]:20}" for ending in endings))
    slowest, largest = max(found, key=lambda case: case.cpu_s), max(found, key=lambda case: case.mb)
    table.append(
        f"slowest: {slowest.cpu_s:.1f} s (case {slowest.case}); largest: {largest.mb:.0f} MB (case {largest.case})"
    )
    for kind in sorted({case.kind for case in found}):
        spent = [case.cpu_s for case in found if case.kind == kind]
        table.append(f"{kind:24}{sum(spent) / len(spent):20.2f} s of processor time in the mean")
    wrong = [case for case in found if case.ending not in FINE]
    return table + [
        f"case {case.case}, {case.kind}, {case.level}: {case.ending}: {' '.join(case.arguments)}\n{case.said}"
        for case in wrong
    ]


def summary(found: Sequence[Ended], seed: int, seconds: float) -> dict[str, Any]:
    """What is written."""
    counts = Counter((case.kind, case.ending) for case in found)
    return {
        "command": f"python -m benchmarks.fuzz --cases {len(found)} --seed {seed} --write",
        "seed": seed,
        "cases": len(found),
        "version": __version__,
        "commit": subprocess.run(
            ["git", "rev-parse", "HEAD"], cwd=Path(__file__).parent, capture_output=True, text=True, check=False
        ).stdout.strip(),
        "python": platform.python_version(),
        "counts": {
            kind: {ending: n for (k, ending), n in sorted(counts.items()) if k == kind}
            for kind in sorted({case.kind for case in found})
        },
        "levels": dict(sorted(Counter(case.level for case in found).items())),
        "wrong": sum(case.ending not in FINE for case in found),
        "slowest_s": max(case.cpu_s for case in found),
        "largest_mb": max(case.mb for case in found),
        "seconds": round(seconds),
    }


if __name__ == "__main__":
    sys.exit(main())
