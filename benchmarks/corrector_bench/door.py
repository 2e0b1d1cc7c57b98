"""Time per correction as a user pays it, by public calls alone: `python -m benchmarks.corrector_bench.door`.

Arguments: ways, comma-separated, a problem, the number of draws, the file to write (.npz). Every draw is corrected each
way in turn, so that a machine whose speed drifts treats all alike. Times are of the processor, of all threads: on a
machine with other work a clock on the wall measures that too.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Sequence
from functools import partial
from types import MappingProxyType
from typing import Any

import numpy as np

import apo_bench
from benchmarks.corrector_bench.draws import draw
from benchmarks.corrector_bench.own import observation
from benchmarks.corrector_bench.problems import problem

YARDSTICK = "paper"
UNCOMPILED = "plain"
CONTACT = "contact"
MANY = "correct_many"
WAYS = MappingProxyType(
    {
        YARDSTICK: "paper",
        UNCOMPILED: apo_bench.ContactCorrector(compiled=False),
        CONTACT: "contact",
        "scipy": "least-squares",
        "gtsam": "benchmarks.corrector_bench.peers_gtsam:gtsam",
        "pyceres": "benchmarks.corrector_bench.peers_ceres:ceres",
    }
)
"""What `apo_bench.correct` is asked for."""
ROUNDS = 5
OPEN_M = 1e-4
"""A correction that leaves a larger gap has failed: the gap at which an observation's contacts count as closed."""


def main(ways: str, name: str, draws: str, out: str) -> None:
    """Writes milliseconds (k, ways) and gaps [m] (k, ways), NaN where a way raised."""
    chosen = ways.split(",")
    ms, gaps = (rounds if chosen == [YARDSTICK, MANY] else each)(name, chosen, int(draws))
    np.savez(out, ms=np.array(ms), gaps=np.array(gaps))


def each(name: str, ways: Sequence[str], draws: int) -> tuple[list[list[float]], list[list[float]]]:
    """One row per draw."""
    of = problem(name)
    ms = list[list[float]]()
    gaps = list[list[float]]()
    for seed in range(draws):
        seen = observation(of, draw(of, "2/1", seed))
        ended = [_timed(partial(apo_bench.correct, seen, WAYS[way]), warm=seed == 0) for way in ways]
        ms.append([spent for spent, _ in ended])
        gaps.append([np.nan if made is None or not made.ok else made.gap_after_m for _, made in ended])
    return ms, gaps


def rounds(name: str, _: Sequence[str], draws: int) -> tuple[list[list[float]], list[list[float]]]:
    """One row per round: the same observations by `paper` in a loop and by `correct_many`, time of one correction."""
    of = problem(name)
    size = 5 * draws
    ms = list[list[float]]()
    gaps = list[list[float]]()
    seen = [observation(of, draw(of, "2/1", seed)) for seed in range(size)]
    for k in range(ROUNDS):
        loop, slow = _timed(partial(_loop, seen), warm=False)
        batch, many = _timed(partial(apo_bench.correct_many, seen, apo_bench.ContactCorrector()), warm=k == 0)
        ms.append([loop / size, batch / size])
        gaps.append([max(made.gap_after_m for made in found) if found else np.nan for found in (slow, many)])
    return ms, gaps


def _loop(seen: Sequence[apo_bench.Observation]) -> list[apo_bench.Correction]:
    return [apo_bench.correct(one, WAYS[YARDSTICK]) for one in seen]


def _timed(verb: Callable[[], Any], warm: bool) -> tuple[float, Any]:
    """Milliseconds of the processor, and what came of it; None if it raised. The first call of a process warms up."""
    try:
        for _ in range(1 + warm):
            start = time.process_time()
            found = verb()
            spent = 1e3 * (time.process_time() - start)
        return spent, found
    except Exception as error:  # a peer may fail in any way; that is a result
        print(f"{type(error).__name__}: {error}", file=sys.stderr)
        return np.nan, None


if __name__ == "__main__":
    main(*sys.argv[1:])
