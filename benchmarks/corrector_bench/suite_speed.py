"""P1 to P3: time of one solve, every peer in its own process, the yardstick and `contact` beside it in turn.

Ratios are medians of paired ratios of processor time, which other work on the machine does not disturb; those by the
clock on the wall stand beside them in the file.
"""

from __future__ import annotations

import importlib.util

import numpy as np

from apo_bench.geometry.arrays import Array
from benchmarks.corrector_bench.draws import draw
from benchmarks.corrector_bench.measures import quality
from benchmarks.corrector_bench.own import COMPILED, PEERS
from benchmarks.corrector_bench.peers import peers
from benchmarks.corrector_bench.problems import FIGURES, problem
from benchmarks.corrector_bench.rows import Row
from benchmarks.corrector_bench.runner import Ran, run

COMPILED_TARGET = {"fig2": "<= 0.15", "fig3": "<= 0.15", "fig6": "<= 0.25"}
OURS = ("newton", *PEERS)
LIMIT_S = 40.0


def suite(draws: int) -> list[Row]:
    """Our own with half of the draws, others with a tenth."""
    rows, gtsam = list[Row](), importlib.util.find_spec("gtsam") is not None
    present = [peer for peer in peers() if peer not in OURS and (gtsam or not peer.startswith("gtsam"))]
    for name in FIGURES:
        rows += _own(name, max(3, draws // 2))
        for peer in present:
            rows += _peer(name, peer, max(3, draws // 10))
    for peer in ("scipy trf", "scipy trf lsmr", "gtsam cholesky"):
        if peer in present:
            rows += _peer("chain20", peer, max(2, draws // 40))
    return rows


def _own(name: str, draws: int) -> list[Row]:
    rows = []
    for id, peer, bound in (("P1", "contact", "<= 1.5"), ("P2", COMPILED, COMPILED_TARGET[name])):
        for what, who in (("whole", peer), ("the solve alone", f"{peer} alone")):
            ran = run(who, name, "2/1", draws, beside=("newton",))
            ok = ran.ended == "ok" and bool((ran.ms > 0).all())
            note = "" if ok else f"not measured ({ran.ended}); is numba installed?" if id == "P2" else ran.ended
            text = f"{peer} over the paper's Newton, time, {what}"
            rows.append(Row(id, name, text, _ratio(ran, 0, 1) if ok else None, bound, note, _times(ran, "newton")))
    return rows


def _peer(name: str, peer: str, draws: int) -> list[Row]:
    ran = run(peer, name, "2/1", draws, beside=("newton", "contact"), limit_s=LIMIT_S)
    if not len(ran.goals):
        return [Row("peer", name, f"{peer}: no solution", None, "", ran.ended)]
    of = problem(name)
    rated = [quality(of, draw(of, "2/1", seed), goals) for seed, goals in enumerate(ran.goals)]
    largest = {f: np.max([getattr(q, f) for q in rated]) for f in ("residual_mm", "drift")}
    detail = {**_times(ran, "newton", "contact"), **largest, "over_newton": _ratio(ran, 0, 1)}
    detail |= {"bad": np.mean([q.overlong for q in rated]), "draws": len(rated), "ended": ran.ended}
    target = (
        {"scipy trf": ">= 5", "gtsam cholesky": ">= 1", "gtsam qr": ">= 1"}.get(peer, "") if name in FIGURES else ""
    )
    note = "residual {residual_mm:.1e} mm, drift {drift:.1e} sigma, longer than truth {bad:.0%}".format(**detail)
    if ran.ended != "ok":
        note = f"{ran.ended} after {len(rated)} draws; {note}"
    return [
        Row("P3" if target else "peer", name, f"{peer} over contact, time", _ratio(ran, 0, 2), target, note, detail)
    ]


def _ratio(ran: Ran, a: int, b: int) -> float:
    """Median of the ratios of paired times."""
    return _paired(ran.ms, a, b)


def _paired(ms: Array, a: int, b: int) -> float:
    ms = ms[(ms > 0).all(axis=1)]
    return float(np.median(ms[:, a] / ms[:, b])) if len(ms) else float("nan")


def _times(ran: Ran, *beside: str) -> dict[str, float]:
    """Medians of every time, and the same ratios by the clock on the wall."""
    if not len(ran.ms):
        return {}
    names = ("ms", *(f"{other}_ms" for other in beside))
    found = {name: float(np.median(x)) for name, x in zip(names, ran.ms.T, strict=True)}
    by_clock = {f"over {other}, by the clock": _paired(ran.wall_ms, 0, 1 + k) for k, other in enumerate(beside)}
    return {**found, **by_clock}
