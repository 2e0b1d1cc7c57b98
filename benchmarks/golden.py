"""Golden data: what the package computes, kept to show that a change of the code changes no result.

    python -m benchmarks.golden --collect OUT [--subset small] [--workers 2]
    python -m benchmarks.golden --compare OTHER [--subset small] [--workers 2]

`--collect` writes one line of JSON an item; a collection that was stopped continues. `--compare` collects here and in
OTHER, another checkout (each runs its own copy of this file) or a file that `--collect` wrote on this machine, prints
what moved and ends with 1 if anything did. `tests/golden/test_golden.py` repeats the subset `small` in every test run.

Design: 15 shipped scenarios and 20 generated assemblies, seeds 0, 1 and 2; some 35 minutes of one core.

- observation, each scenario and seed (105): demonstrated poses, error of the observed ones, covariance. Seed 0 has
  isotropic noise, the noise models take turns in seeds 1 and 2. detection: the contacts that are found in it.
- correction, each observation by each of `CORRECTORS` (735): all that the corrector returns.
- trial, each scenario and seed by each of `METHODS` (840). Fidelities alternate over seeds, so that each scenario has
  each method in both. Noise is 1, 2 and 0.5 mm and degrees in seeds 0, 1 and 2.
- trial, each of `OPTIONS` in turn, two a seed of shipped scenarios, one a seed of generated ones (150, each option four
  times or more): probing, spiral search, depth camera, robot errors, contact sources, noise models and the rest.
- episode, each scenario with one seed in `APOReplay-v0`, `APOTrack-v0` and `APOInsert-v0` (105), by fixed actions.

Left out are texts, settings that a record repeats, provenance and iterations of solvers (`DROPPED`). Numbers have 12
digits; poses are in mm, covariances in mm^2 and mrad^2. Items of the subset `small` are collected a second time,
perturbed: poses are observed 1e-9 m and rad elsewhere, and in trials and episodes the clearance is 1e-9 m larger as
well. Trials and episodes that end the same, and corrections that move by less than 1e-4 mm and rad, are marked stable:
only those repeat on other processors.

`benchmarks/golden_items.py` lists the items; after a rename in the package, change its tables of names.
"""

from __future__ import annotations

import argparse
import json
import lzma
import math
import os
import subprocess
import sys
import tempfile
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from importlib.metadata import version
from multiprocessing import get_context
from pathlib import Path
from typing import Any

from benchmarks.golden_items import Item, design
from benchmarks.golden_values import PERTURBATION, compute

SAME = 1e-9
"""What two checkouts may differ by on one machine: [mm], [rad], or a part of numbers above 1."""
CLOSE = 2e-5
"""What stable corrections may differ by on another processor, in the same units. Solvers stop when a step is small, so
that rounding decides about the last one: under other kernels of OpenBLAS and NumPy 5e-6 was the largest."""
STABLE = 1e-4
"""By what the perturbation, 1e-6 mm, may move a stable correction."""
VERDICT = ("success", "as_demonstrated", "loose_success", "failure_stage", "failure_code", "error")


def repeats(item: Item, values: Mapping[str, Any]) -> bool:
    """Whether a small perturbation leaves the end of an item as it is."""
    again = compute(item, PERTURBATION)
    if item.kind in ("trial", "episode"):
        return all(values.get(key) == again.get(key) for key in VERDICT)
    return not list(moved(values, again, STABLE))


def moved(old: Mapping[str, Any], new: Mapping[str, Any], allowed: float) -> Iterator[tuple[str, Any, Any, float]]:
    """What differs between two items: key, old and new value where they differ most, and by how much."""
    for key in [*old, *(key for key in new if key not in old)]:
        a, b = (each.get(key) for each in (old, new))
        lists = isinstance(a, list) and isinstance(b, list) and len(a) == len(b)
        pairs = zip(a, b, strict=True) if lists else [(a, b)]
        x, y, off = max(((x, y, distance(x, y)) for x, y in pairs), key=lambda each: each[2], default=("", "", 0.0))
        if off > allowed:
            yield key, x, y, off


def distance(a: Any, b: Any) -> float:
    """How far two values are apart: numbers above 1 by their ratio, others that are not equal infinitely."""
    if a == b or repr(a) == repr(b):  # not a number twice is the same
        return 0.0
    numbers = all(isinstance(x, int | float) and not isinstance(x, bool) and math.isfinite(x) for x in (a, b))
    return abs(a - b) / max(1.0, abs(a)) if numbers else math.inf


def lines_of(items: Sequence[Item], with_stability: bool) -> list[str]:
    """The lines of some items, as a worker makes them."""
    lines = []
    for item in items:
        line = {"item": item.name, "values": compute(item)}
        if item.small and with_stability:
            line["stable"] = repeats(item, line["values"])
        lines.append(json.dumps(line))
    return lines


def read(path: Path) -> dict[str, Any]:
    """The lines of a collection, by item; without what a collection that was stopped wrote last."""
    data = path.read_bytes()
    text = (lzma.decompress(data) if path.suffix == ".xz" else data).decode()
    lines = (json.loads(line) for line in text.splitlines(keepends=True) if line.endswith("\n"))
    return {line["item"]: line for line in lines if "item" in line}


def collect(out: Path, subset: str, workers: int, with_stability: bool) -> None:
    """Compute what the unfinished file of `out` does not hold yet, and write all in the order of the design."""
    part = out.with_name(out.name + ".part")
    found = read(part) if part.exists() else {}
    wanted = [item for item in design() if subset == "whole" or item.small]
    groups = defaultdict[tuple[str, int], list[Item]](list)
    for item in wanted:
        if item.name not in found:
            groups[item.scenario, item.seed].append(item)
    with part.open("w", encoding="utf-8") as file, get_context("spawn").Pool(workers) as pool:
        file.writelines(json.dumps(line) + "\n" for line in found.values())
        made = partial(lines_of, with_stability=with_stability)
        for lines in pool.imap_unordered(made, groups.values()):
            file.writelines(line + "\n" for line in lines)
            file.flush()
            print(f"{len(lines)} more items, up to {json.loads(lines[-1])['item']}", file=sys.stderr, flush=True)
    found = read(part)
    versions = {name: version(name) for name in ("mujoco", "numpy", "scipy")}
    head = {"made_by": f"python -m benchmarks.golden --collect {out.name} --subset {subset}", "with": versions}
    text = "".join(json.dumps(line) + "\n" for line in (head, *(found[item.name] for item in wanted)))
    out.write_bytes(lzma.compress(text.encode()) if out.suffix == ".xz" else text.encode())
    part.unlink()


def collected(checkout: Path, subset: str, workers: int, folder: str) -> dict[str, Any]:
    """What a checkout computes, by its own copy of this file."""
    out = Path(folder) / f"{len(os.listdir(folder))}.jsonl"
    command = [sys.executable, "-m", "benchmarks.golden", "--collect", str(out), "--subset", subset]
    command += ["--workers", str(workers), "--once"]
    threads = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    subprocess.run(command, check=True, cwd=checkout, env=os.environ | threads | {"PYTHONPATH": str(checkout)})
    return read(out)


def compare(other: Path, subset: str, workers: int) -> int:
    """Print what moved from `other` to this checkout, and return how much did."""
    wanted = {item.name for item in design() if subset == "whole" or item.small}
    with tempfile.TemporaryDirectory() as folder:
        old = read(other) if other.is_file() else collected(other.resolve(), subset, workers, folder)
        new = collected(Path(__file__).resolve().parents[1], subset, workers, folder)
    old = {name: line for name, line in old.items() if name in wanted}
    rows = []
    for name in [*old, *(name for name in new if name not in old)]:
        pair = [each.get(name, {"values": {"item": "missing"}})["values"] for each in (old, new)]
        rows += [(name, *each) for each in moved(pair[0], pair[1], SAME)]
    if rows:
        print("item | key | from | to | largest difference")
    for name, key, a, b, off in rows:
        print(f"{name} | {key} | {a} | {b} | {'-' if math.isinf(off) else f'{off:.2g}'}")
    print(f"{len({row[0] for row in rows})} of {len(old | new)} items moved")
    return len(rows)


def main() -> None:
    asked = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    what = asked.add_mutually_exclusive_group(required=True)
    what.add_argument("--collect", type=Path, metavar="OUT", help="file to write; compressed if it ends in .xz")
    what.add_argument("--compare", type=Path, metavar="OTHER", help="another checkout, or a collection")
    asked.add_argument("--subset", choices=("small", "whole"), default="whole")
    asked.add_argument("--workers", type=int, default=1, help="processes")
    asked.add_argument("--once", action="store_true", help="do not look for what is stable")
    given = asked.parse_args()
    if given.collect:
        collect(given.collect, given.subset, given.workers, not given.once)
    else:
        sys.exit(compare(given.compare, given.subset, given.workers) > 0)


if __name__ == "__main__":
    main()
