"""What `apo-bench noise fit` found, as JSON and in words."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from apo_bench.geometry.arrays import Array
from apo_bench.observation.fitting.fit import PERCENTILES, Figures
from apo_bench.observation.models.fitted import MeasuredNoise
from apo_bench.observation.models.residuals import INLIER_MM, TURNED_DEG, Residuals
from apo_bench.observation.models.tails import Split

_SCHEMA = "apo-bench/noise-fit/1"


def fit_form(residuals: Residuals, measured: MeasuredNoise, figures: Sequence[Figures]) -> dict[str, Any]:
    """Everything that was counted and fitted: mm and degrees; degrees of freedom are null for a Gaussian."""
    inlier = residuals.inlier
    mean, error = _bias(residuals)
    return {
        "schema": _SCHEMA,
        "source": measured.source,
        "parts": len(residuals.where),
        "images": len(np.unique(residuals.where[:, :2], axis=0)),
        "distance_mm": residuals.distance_mm,
        "found": int(residuals.found.sum()),
        "missed_rate": measured.missed,
        "left_over": residuals.surplus,
        "inliers": int(inlier.sum()),
        "outlier_rate": measured.outliers,
        "outlier_farthest_mm": measured.farthest_mm,
        "turned": int(inlier.sum() - residuals.upright.sum()),
        "bias_mm": mean.tolist(),
        "bias_standard_error_mm": error.tolist(),
        "along_over_across": _ratio(residuals),
        "percentiles": list(PERCENTILES),
        "inlier_across_mm": _percentiles(residuals.across_mm[inlier]),
        "inlier_along_mm": _percentiles(residuals.along_mm[inlier]),
        "inlier_turn_deg": _percentiles(residuals.angle_deg[inlier]),
        "inlier_turn_by_trace_deg": _percentiles(residuals.trace_deg[inlier]),
        "fit": {
            f.name: {
                "unit": f.unit,
                "observed": f.observed.tolist(),
                "fitted": f.fitted.tolist(),
                "kolmogorov_smirnov": f.distance,
            }
            for f in figures
        },
        "shift_mm": _split_form(measured.shift_mm),
        "turn_deg": _split_form(measured.turn_deg),
    }


def fit_lines(residuals: Residuals, measured: MeasuredNoise, figures: Sequence[Figures]) -> list[str]:
    """A fit in words, line by line."""
    n, found, inlier = len(residuals.where), int(residuals.found.sum()), int(residuals.inlier.sum())
    turned, (mean, error) = inlier - int(residuals.upright.sum()), _bias(residuals)
    turns = _percentiles(residuals.angle_deg[residuals.inlier])[:2]
    by_trace = _percentiles(residuals.trace_deg[residuals.inlier])[:2]
    images = len(np.unique(residuals.where[:, :2], axis=0))
    facts = [
        ("source", measured.source),
        ("parts", f"{n} in {images} images, {residuals.distance_mm:.0f} mm away in the median"),
        (
            "found",
            f"{found}; {n - found} missed ({100 * measured.missed:.1f} %); {residuals.surplus} estimates left over",
        ),
        (
            "inliers",
            f"{inlier} off by less than {INLIER_MM:g} mm; {found - inlier} outliers "
            f"({100 * measured.outliers:.1f} % of those found)",
        ),
        (
            "turned",
            f"{turned} inliers by more than {TURNED_DEG:g} deg, not told from parts that look alike when turned",
        ),
        (
            "bias",
            ", ".join(f"{a} {m:.2f} ± {e:.2f}" for a, m, e in zip(("x", "y", "along"), mean, error, strict=True))
            + " mm, counted into the size of errors",
        ),
        ("along:across", f"{_ratio(residuals):.2f}, medians of inliers"),
        (
            "angle",
            f"p25 {turns[0]:.2f}, p50 {turns[1]:.2f} deg of all inliers; "
            f"{by_trace[0]:.2f} and {by_trace[1]:.2f} by the traces of the matrices as written",
        ),
        *_tail_facts("shift", ("across the ray", "along the ray"), measured.shift_mm, "mm"),
        *_tail_facts("turn", ("across the ray", "about the ray"), measured.turn_deg, "deg"),
    ]
    width = max(len(name) for name, _ in facts)
    lines = [f"{name:{width}}  {text}" for name, text in facts]
    lines += ["", " " * 27 + "".join(f"{f'p{p}':>8}" for p in PERCENTILES) + "  Kolmogorov-Smirnov"]
    for f in figures:
        for word, values, more in (
            ("seen", f.observed, ""),
            ("fitted", f.fitted, f"{f.distance:20.3f}"),
        ):
            name = f"{f.name} [{f.unit}]" if word == "seen" else ""
            lines.append(f"{name:20}{word:7}" + "".join(f"{v:8.2f}" for v in values) + more)
    return lines


def _bias(residuals: Residuals) -> tuple[Array, Array]:
    """Mean and its standard error of the shifts of inliers, (3,) each, mm in the frame of the ray."""
    shift = residuals.shift_mm[residuals.inlier]
    return shift.mean(axis=0), shift.std(axis=0) / np.sqrt(len(shift))


def _ratio(residuals: Residuals) -> float:
    """Median error along the ray over that across, of inliers."""
    across = float(np.median(residuals.across_mm[residuals.inlier]))
    return float(np.median(residuals.along_mm[residuals.inlier])) / max(across, 1e-9)


def _percentiles(values: Array) -> list[float]:
    return [float(x) for x in np.percentile(values, PERCENTILES)]


def _split_form(split: Split) -> dict[str, Any]:
    tails = {"across": split.across, "along": split.along}
    return {"limit": split.limit} | {
        name: {"scale": t.scale, "degrees_of_freedom": t.freedom if np.isfinite(t.freedom) else None}
        for name, t in tails.items()
    }


def _tail_facts(name: str, directions: tuple[str, str], split: Split, unit: str) -> list[tuple[str, str]]:
    """One line for each direction: the tail, and the standard deviation that follows within the limit."""
    facts = []
    for direction, tail, variance in zip(directions, (split.across, split.along), split.variances, strict=True):
        shape = f"Student t with {tail.freedom:.3g} degrees of freedom" if np.isfinite(tail.freedom) else "Gaussian"
        text = f"{direction}: scale {tail.scale:.3g} {unit}, {shape}; deviation {np.sqrt(variance):.3g} {unit} below "
        facts.append((name, text + f"{split.limit:g} {unit}"))
    return facts
