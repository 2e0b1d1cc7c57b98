"""Do verdicts depend on the processor? `python benchmarks/processors.py [--scenarios ...] [--methods ...] [--seeds 3]`.

Trials whose verdicts tests/success_rate.json holds are repeated with the kernels of this processor and under every
switch of benchmarks/switches.py that takes, whether or not the physics then runs to the recorded bits; what differs is
printed and written to benchmarks/results/processors.json, also where the verdict `success`, which is not recorded,
differs from that of the first run. All trials with ten seeds take some ten minutes per switch on one idle core.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
from collections.abc import Mapping, Sequence
from importlib import metadata
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

from benchmarks.switches import Switch, missing, run, switches, under
from tests.trial.test_success_rate import CASES, RECORD, SEEDS, bits, trial

RESULT = Path(__file__).parent / "results" / "processors.json"
TOLD = ("as_demonstrated", "success", "failure_stage", "failure_code", "sentence")
Trial = tuple[str, str, int]


def trials(scenarios: Sequence[str], methods: Sequence[str], seeds: int) -> list[Trial]:
    chosen = [(name, method) for name, method in CASES if name in scenarios and method in methods]
    return [(name, method, seed) for name, method in sorted(chosen) for seed in SEEDS[:seeds]]


def ended(asked: Sequence[Trial]) -> dict[str, Any]:
    """How these trials end in this process, and where one demonstration of each scenario ends, as a hash."""
    rows = [trial(*one) for one in asked]
    return {
        "bits": {name: bits(name) for name in dict.fromkeys(name for name, _, _ in asked)},
        "rows": [{key: row[key] for key in TOLD} for row in rows],
    }


def compared(
    switch: Switch, asked: Sequence[Trial], found: Mapping[str, Any], first: Mapping[str, Any]
) -> dict[str, Any]:
    """What differs from the record, and in `success` from the first run."""
    recorded = json.loads(RECORD.read_text(encoding="utf-8"))
    differ = []
    for (name, method, seed), row, before in zip(asked, found["rows"], first["rows"], strict=True):
        expected = recorded[name]["verdicts"][method][seed] == "1"
        if row["as_demonstrated"] != expected or row["success"] != before["success"]:
            was = {"recorded as_demonstrated": expected, "success of the first run": before["success"]}
            differ.append({"scenario": name, "method": method, "seed": seed, **was, **row})
    return {
        "switch": switch.name,
        "openblas": switch.kernels.blas,
        "numpy": switch.kernels.numpy,
        "numba": switch.kernels.numba[:1],
        "trials": len(asked),
        "demonstrations with other bits": [
            name for name, hashed in found["bits"].items() if hashed != recorded[name]["bits"]
        ],
        "verdicts that differ": differ,
    }


def main() -> int:
    asked = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    asked.add_argument("--scenarios", nargs="+", choices=sorted({name for name, _ in CASES}), help="all if left out")
    asked.add_argument("--methods", nargs="+", choices=sorted({method for _, method in CASES}), help="all if left out")
    asked.add_argument("--seeds", type=int, choices=range(1, len(SEEDS) + 1), default=len(SEEDS), help="the first N")
    asked.add_argument("--here", action="store_true", help="print how they end in this process, as JSON, and no more")
    given = asked.parse_args()
    chosen = trials(given.scenarios or [n for n, _ in CASES], given.methods or [m for _, m in CASES], given.seeds)
    if not chosen:
        asked.error("no verdicts of these scenarios and methods are recorded")
    if given.here:
        if wrong := missing():
            sys.exit(wrong)
        print(json.dumps(ended(chosen)))
        return 0
    own = under({})
    if isinstance(own, str):
        sys.exit(f"the kernels of this processor are not known: {own}")
    results = list[dict[str, Any]]()
    left_out = list[str]()
    first = None
    for switch in (Switch("none", {}, own), *switches(own)):
        if isinstance(switch, str):
            print(switch)
            left_out.append(switch)
            continue
        ran = run(switch, [sys.executable, "-P", __file__, "--here", *sys.argv[1:]], stdout=subprocess.PIPE)
        if ran.returncode != 0:
            sys.exit(f"the trials under the switch {switch.name} ended with {ran.returncode}")
        found = json.loads(ran.stdout.splitlines()[-1])
        first = first or found
        results.append(compared(switch, chosen, found, first))
        print(json.dumps(results[-1], indent=1), flush=True)
        written(results, left_out)
    return 0


def written(results: Sequence[Mapping[str, Any]], left_out: Sequence[str]) -> None:
    told = {
        "command": " ".join(("python benchmarks/processors.py", *sys.argv[1:])),
        "versions": {name: metadata.version(name) for name in ("mujoco", "numpy", "scipy", "numba")},
        "not run": left_out,
        "runs": results,
    }
    RESULT.write_text(json.dumps(told, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    sys.exit(main())
