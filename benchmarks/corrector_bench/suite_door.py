"""P1 to P4: time per correction through the public door, over that of `paper` through the same door.

Ratios are medians of ratios of one draw, of processor time. A peer that raised, or left a contact open on any draw, is
not timed: what it did is said instead.
"""

from __future__ import annotations

import tempfile
from pathlib import Path

import numpy as np

from apo_bench.geometry import Array
from benchmarks.corrector_bench.door import CONTACT, MANY, OPEN_M, UNCOMPILED, YARDSTICK
from benchmarks.corrector_bench.problems import FIGURES
from benchmarks.corrector_bench.rows import TrialRecord
from benchmarks.corrector_bench.runner import process

PEERS = {
    "scipy": "SciPy `trf`: `correct(seen, 'least-squares')`",
    "gtsam": "GTSAM: `correct(seen, 'peers_gtsam:gtsam')`",
    "pyceres": "pyceres: `correct(seen, 'peers_ceres:ceres')`",
}
TOGETHER = {"fig2": "<= 0.05", "fig3": "<= 0.07", "fig6": "<= 0.1"}
LIMIT_S = 300.0


def suite(draws: int) -> list[TrialRecord]:
    """Our own on all draws, five times as many together, peers on a tenth."""
    rows = list[TrialRecord]()
    for name in FIGURES:
        ms, _, note = _measured([YARDSTICK, UNCOMPILED, CONTACT], name, draws)
        rows.append(_row("P1", name, "`paper`: `correct(seen, 'paper')`", ms, 0, "", note))
        rows.append(_row("P1", name, f"`contact` not compiled: {_UNCOMPILED}", ms, 1, "<= 1.3", note))
        rows.append(_row("P2", name, "`contact`: `correct(seen, 'contact')`", ms, 2, "<= 0.35", note))
        ms, _, note = _measured([YARDSTICK, MANY], name, draws)
        rows.append(_row("P4", name, f"{5 * draws:,} at once: `correct_many(seen)`", ms, 1, TOGETHER[name], note))
        for peer, what in PEERS.items():
            ms, gaps, note = _measured([YARDSTICK, peer], name, max(3, draws // 10))
            rows.append(_row("P3", name, what, ms, 1, "", note or fault(gaps[:, 1])))
    return rows


_UNCOMPILED = "`correct(seen, ContactCorrector(compiled=False))`"


def _measured(ways: list[str], name: str, draws: int) -> tuple[Array, Array, str]:
    """Milliseconds and gaps [m], (k, ways), and what went wrong with the process."""
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "out.npz"
        arguments = ["-m", "benchmarks.corrector_bench.door", ",".join(ways), name, str(draws), str(out)]
        ended, seconds = process(arguments, LIMIT_S)
        if not out.exists():
            none = np.full((1, len(ways)), np.nan)
            return none, none, f"{ended} after {seconds:.0f} s"
        with np.load(out) as left:
            return left["ms"], left["gaps"], ""


def fault(gaps: Array) -> str:
    """Why a way is not timed; empty if it closed every contact of every draw."""
    raised = int(np.isnan(gaps).sum())
    worst = float(np.nanmax(gaps, initial=0.0))
    if raised == len(gaps):
        return "no solution"
    left = int((gaps > OPEN_M).sum())
    if not raised and not left:
        return ""
    return f"fails on {raised + left} of {len(gaps)} draws: up to {1e3 * worst:.2g} mm open"


def _row(id: str, name: str, what: str, ms: Array, way: int, target: str, fault: str) -> TrialRecord:
    if fault:
        return TrialRecord(id, name, what, None, target, fault)
    ratio = float(np.median(ms[:, way] / ms[:, 0]))
    detail = {"ms": float(np.median(ms[:, way])), "paper_ms": float(np.median(ms[:, 0])), "draws": len(ms)}
    return TrialRecord(id, name, what, ratio, target, "", detail)
