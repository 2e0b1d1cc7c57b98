"""What strangers' files do to the command line: valid files of every kind, made wrong, thousands of times.

    python -m benchmarks.fuzz [--cases 10000] [--seed 0] [--workers 1] [--kind KIND ..] [--write [FILE]] [--case N]

Every case draws a kind of file, changes one file of it in one to four places (bytes, tokens or structure, see
`fuzz_mutate.py`) or puts something in its place that is no file, and runs one command that reads it:
`apo_bench.cli.app.main`, in a fork of this process, in a folder of its own. It must end with exit code 0, 1 or 2,
without a traceback, in 10 s of processor time and 1 GB of memory (CAD, logs and arms: 20 s, 2 GB), and say one sentence
at most that a terminal only shows. It may run no code and start no program, and write no file but those it was asked
for (see `fuzz_watch.py`). `--case N` runs one case again and shows it; `--write` puts the counts of the kinds that were
drawn into `results/fuzz.json`, in place of those of the same kinds. Case i is drawn from `default_rng([seed, i])`.
"""

from __future__ import annotations

import argparse
import gc
import json
import os
import platform
import re
import resource
import shlex
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import traceback
from collections import Counter
from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from apo_bench import __version__
from apo_bench.cli import app as cli
from apo_bench.errors import InputError
from benchmarks.fuzz_files import kinds
from benchmarks.fuzz_kind import Kind
from benchmarks.fuzz_mutate import RAN, mutated
from benchmarks.fuzz_watch import BESIDE, WROTE, changed_files, lay_out, watch

RESULT = Path(__file__).parent / "results" / "fuzz.json"
PATIENCE_S = 120
"""Of the clock: other processes may have the processor."""
LONGEST_SENTENCE = 2000
ELSEWHERE = "elsewhere"
"""An empty file that no command may write."""
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
    parser.add_argument("--kind", action="append", help="only this one, or these; default: all")
    parser.add_argument("--case", type=int)
    parser.add_argument("--write", type=Path, nargs="?", const=RESULT)
    asked = parser.parse_args()
    if asked.case is not None:
        with tempfile.TemporaryDirectory() as work:
            print(run_case(prepared(Path(work), asked.kind), asked.seed, asked.case, Path(work), show=True))
        return 0
    found = fuzz(asked.cases, asked.seed, asked.workers, asked.kind)
    for line in lines(found):
        print(line)
    if asked.write:
        words = ["python", "-m", "benchmarks.fuzz", "--cases", str(asked.cases), "--seed", str(asked.seed)]
        words += [word for kind in asked.kind or () for word in ("--kind", kind)]
        kept = json.loads(asked.write.read_text()) if asked.write.exists() else {}
        asked.write.write_text(json.dumps(summary(found, shlex.join([*words, "--write"]), kept), indent=1) + "\n")
    return int(any(case.ending not in FINE for case in found))


def fuzz(cases: int, seed: int, workers: int = 1, only: Sequence[str] | None = None) -> list[Ended]:
    """Run cases 0, 1, ..., every worker its share."""
    with tempfile.TemporaryDirectory() as name:
        work = Path(name)
        made = prepared(work, only)
        sheets = [work / f"sheet{w}" for w in range(workers)]
        children = []
        for w, sheet in enumerate(sheets):
            if child := os.fork():
                children.append(child)
                continue
            try:
                _run_share(range(w, cases, workers), made, seed, work, sheet)
            except BaseException:
                traceback.print_exc()
            finally:
                os._exit(0)  # not through the folder's end, which is the parent's
        for child in children:
            os.waitpid(child, 0)
        found = [Ended(*json.loads(line)) for sheet in sheets for line in sheet.read_text().splitlines()]
    if len(found) != cases:
        raise RuntimeError(f"{cases - len(found)} cases are missing")
    return sorted(found)


def _run_share(share: range, made: Mapping[str, Kind], seed: int, work: Path, sheet: Path) -> None:
    with sheet.open("w", buffering=1) as out:
        for case in share:
            ended = run_case(made, seed, case, work)
            out.write(json.dumps(ended) + "\n")
            if ended.ending not in FINE:
                print(f"case {case}, {ended.kind}: {ended.ending}", file=sys.stderr, flush=True)


def prepared(work: Path, only: Sequence[str] | None = None) -> Mapping[str, Kind]:
    """Valid files, each read once here, so that a fork has what it needs imported.

    Args:
        only: Kinds that are wanted; None: all.
    """
    with open(os.devnull, "w") as nowhere:
        stdout = sys.stdout
        sys.stdout = nowhere
        try:
            (work / ELSEWHERE).touch()
            made = kinds(work)
            if unknown := set(only or ()) - set(made):
                raise InputError(f"unknown kinds {sorted(unknown)}; {', '.join(made)} are there.")
            made = {name: kind for name, kind in made.items() if only is None or name in only}
            for name, kind in made.items():
                for k, arguments in enumerate({tuple(command): None for command in kind.commands}):
                    place = work / "valid" / f"{name} {k}"
                    lay_out(kind.files, place, traps=False)
                    code = _within(place, arguments)
                    if code != _expected(arguments) and not (kind.may_be_refused and code == cli.WRONG_REQUEST):
                        raise RuntimeError(f"{name}: {arguments} ended with exit code {code}")
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
    place = work / f"case{case}"
    lay_out(kind.files, place)
    changed = kind.changed[int(rng.integers(len(kind.changed)))]
    path = place / changed
    arguments = kind.commands[int(rng.integers(len(kind.commands)))]
    before = dict(kind.files)
    if rng.random() < SPECIAL:
        level = _special(path, rng)
        del before[changed]
    else:
        level, before[changed] = mutated(path.read_bytes(), path.suffix, rng, kind.structure)
        path.write_bytes(before[changed])
    special = () if changed in before else (changed,)
    out = arguments[arguments.index("--out") + 1] if "--out" in arguments else ""
    if out and not (place / out).exists() and rng.random() < SPECIAL:
        (place / out).symlink_to(work / ELSEWHERE)
        level = "link at --out"
        special = (*special, out)
    if show:
        print(f"{name}, {level}, {path.name}: apo-bench {' '.join(arguments)}")
        print(path.read_bytes()[:4000].decode(errors="replace") if path.is_file() else level)
    ending, cpu_s, mb, said = _forked(place, arguments, kind.longest_s, kind.largest_mb)
    changes = changed_files(place, before, kind.writes, special)
    if ending in FINE and (changes or (work / ELSEWHERE).read_bytes()):
        ending = WROTE
        said = f"{changes}\n{said}"
        (work / ELSEWHERE).write_bytes(b"")
    if show:
        print(said)
    shutil.rmtree(place)
    return Ended(case, name, level, arguments, ending, cpu_s, mb, said if ending not in FINE else "")


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


def _forked(
    place: Path, arguments: Sequence[str], longest_s: float = 10, largest_mb: float = 1000
) -> tuple[str, float, float, str]:
    """Ending, processor time [s], memory [MB] and what was said, of one command; what it has started ends with it."""
    with tempfile.TemporaryFile() as out, tempfile.TemporaryFile() as err:
        child = os.fork()
        if not child:
            _become(place, arguments, out.fileno(), err.fileno(), longest_s)
        until = time.perf_counter() + PATIENCE_S
        status = None
        while status is None:
            found, state, used = os.wait4(child, os.WNOHANG)
            if found:
                status = state
            elif time.perf_counter() > until:
                os.kill(child, signal.SIGKILL)
                until = np.inf
            else:
                time.sleep(0.002)
        with suppress(ProcessLookupError, PermissionError):
            os.killpg(child, signal.SIGKILL)
        said, printed = ((file.seek(0), file.read(1_000_000).decode(errors="replace"))[1] for file in (err, out))
    if arguments[0] == "sweep":  # whose file may name code
        said = said.replace(f"{RAN}\n", "")
    cpu_s = used.ru_utime + used.ru_stime
    mb = used.ru_maxrss / 1e3
    if until == np.inf or cpu_s > longest_s:
        ending = f"longer than {longest_s:g} s"
    elif mb > largest_mb:
        ending = f"more than {largest_mb:g} MB"
    else:
        ending = _ending(status, printed, said)
    return ending, round(cpu_s, 2), round(mb), said[-3000:]


def _ending(status: int, printed: str, said: str) -> str:
    if os.WIFSIGNALED(status):
        return f"signal {os.WTERMSIG(status)}"
    for beside in (RAN, *BESIDE):
        if beside in said:
            return beside
    if "Traceback (most recent call last)" in said or "recursion depth" in said:
        return "traceback"
    if (code := os.WEXITSTATUS(status)) not in (0, 1, 2):
        return f"exit code {code}"
    if CONTROL.search(printed) or CONTROL.search(said):
        return "control characters"
    if said.count("\n") > 1 or len(said) > LONGEST_SENTENCE or (code == 2 and not said.startswith("apo-bench: ")):
        return "not one sentence"
    return f"exit code {code}"


def _become(place: Path, arguments: Sequence[str], out: int, err: int, longest_s: float) -> None:
    """Run the command here, as its own process would, and end."""
    code = 1
    try:
        os.setsid()
        resource.setrlimit(resource.RLIMIT_CPU, (int(longest_s) + 5, int(longest_s) + 10))
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
        resource.setrlimit(resource.RLIMIT_AS, (8 * 10**9, 8 * 10**9))
        for number, file in ((0, os.open(os.devnull, os.O_RDONLY)), (1, out), (2, err)):
            os.dup2(file, number)
        sys.stdout = open(1, "w", encoding="utf-8", closefd=False)  # noqa: SIM115
        sys.stderr = open(2, "w", encoding="utf-8", errors="backslashreplace", closefd=False)  # noqa: SIM115
        watch(place)
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
    slowest = max(found, key=lambda case: case.cpu_s)
    largest = max(found, key=lambda case: case.mb)
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


def summary(found: Sequence[Ended], command: str, kept: Mapping[str, Any]) -> dict[str, Any]:
    """What is written: the counts of each kind, with the command that made them.

    Args:
        kept: What was written before, of other kinds.
    """
    commit = subprocess.run(
        ["git", "rev-parse", "HEAD"], cwd=Path(__file__).parent, capture_output=True, text=True, check=False
    ).stdout.strip()
    of_kinds = dict(kept.get("kinds", {}))
    for kind in {case.kind for case in found}:
        cases = [case for case in found if case.kind == kind]
        of_kinds[kind] = {
            "command": command,
            "commit": commit,
            "version": __version__,
            "python": platform.python_version(),
            "cases": len(cases),
            "wrong": sum(case.ending not in FINE for case in cases),
            "endings": dict(sorted(Counter(case.ending for case in cases).items())),
            "levels": dict(sorted(Counter(case.level for case in cases).items())),
            "slowest_s": max(case.cpu_s for case in cases),
            "largest_mb": max(case.mb for case in cases),
        }
    total = {name: sum(of[name] for of in of_kinds.values()) for name in ("cases", "wrong")}
    return {**total, "kinds": dict(sorted(of_kinds.items()))}


if __name__ == "__main__":
    sys.exit(main())
