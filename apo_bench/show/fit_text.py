"""What `apo-bench noise fit` found, as JSON and in words.

How well a fit fits: histograms with the fitted densities, and quantiles against quantiles.
"""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from apo_bench.geometry import Array
from apo_bench.io import columns, default_looks, save_figure
from apo_bench.observation.fitting.fit import PERCENTILES, Figures, outliers_by_score
from apo_bench.observation.models import INLIER_MM, TURNED_DEG, MeasuredNoise, Residuals, Split

_SCHEMA = "apo-bench/noise-fit/2"
_RARE = 0.01


def fit_form(residuals: Residuals, measured: MeasuredNoise, figures: Sequence[Figures]) -> dict[str, Any]:
    """Everything that was counted and fitted: mm and degrees; degrees of freedom are null for a Gaussian."""
    inlier = residuals.inlier
    mean, error = _bias(residuals)
    return {
        "schema": _SCHEMA,
        "source": measured.source,
        "parts": len(residuals.where),
        "images": _images(residuals),
        "distance_mm": residuals.distance_mm,
        "found": int(residuals.found.sum()),
        "missed_rate": measured.missed,
        "left_over": residuals.surplus,
        "of_absent_objects": residuals.absent,
        "inliers": int(inlier.sum()),
        "outlier_rate": measured.outliers,
        "outlier_farthest_mm": measured.farthest_mm,
        "outliers_by_score": [band._asdict() for band in outliers_by_score(residuals)],
        "turned": int(inlier.sum() - residuals.upright.sum()),
        "turned_and_off": _turned_and_off(residuals, measured),
        "round_objects": list(residuals.round_objects),
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
                "kolmogorov_smirnov_by_chance": f.by_chance,
            }
            for f in figures
        },
        "shift_mm": _split_form(measured.shift_mm),
        "turn_deg": _split_form(measured.turn_deg),
    }


def fit_lines(residuals: Residuals, measured: MeasuredNoise, figures: Sequence[Figures]) -> list[str]:
    """A fit in words, line by line."""
    n = len(residuals.where)
    seen = int(residuals.found.sum())
    inlier = int(residuals.inlier.sum())
    mean, error = _bias(residuals)
    turns = _percentiles(residuals.angle_deg[residuals.inlier])[:2]
    by_trace = _percentiles(residuals.trace_deg[residuals.inlier])[:2]
    facts = [
        ("source", measured.source),
        ("parts", f"{n} in {_images(residuals)} images, {residuals.distance_mm:.0f} mm away in the median"),
        ("found", f"{seen}; {n - seen} missed ({100 * measured.missed:.1f} %); {_left_over(residuals)}"),
        (
            "inliers",
            f"{inlier} off by less than {INLIER_MM:g} mm; {seen - inlier} outliers "
            f"({100 * measured.outliers:.1f} % of those found)",
        ),
        *_score_fact(residuals),
        ("turned", _turned(residuals, measured)),
        *_round_fact(residuals),
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
        *_tail_facts("shift", ("across the ray", "along the ray"), measured.shift_mm, "mm", figures[:2]),
        *_tail_facts("turn", ("across the ray", "about the ray"), measured.turn_deg, "deg", figures[2:]),
    ]
    quantiles = [
        row for f in figures for row in ((f"{f.name} [{f.unit}]", "seen", f.observed), ("", "fitted", f.fitted))
    ]
    return [
        *columns(facts),
        "",
        " " * 33 + "".join(f"{f'p{p}':>8}" for p in PERCENTILES),
        *(f"{name:26}{word:7}" + "".join(f"{v:8.2f}" for v in values) for name, word, values in quantiles),
    ]


def fit_notes(residuals: Residuals, measured: MeasuredNoise, figures: Sequence[Figures]) -> tuple[str, ...]:
    """What a reader of the noise file should know of the fit, one line each."""
    upright = int(residuals.upright.sum())
    known = int(residuals.turn_known.sum())
    return (
        f"Level 1 is as measured, {residuals.distance_mm / 1e3:.2f} m from the camera in the median: mm and degrees, "
        "Student t, none beyond the limit.",
        f"Shifts are of {upright} inliers turned by less than {TURNED_DEG:g} deg, turns of {known} of them.",
        f"Symmetries are not known: {_turned(residuals, measured)}.",
        *(f"{text[0].upper()}{text[1:]}." for _, text in _round_fact(residuals)),
        *(f"{f.name[0].upper()}{f.name[1:]}: {_goodness(f)}." for f in figures),
        *(f"Outliers by score: {text}." for _, text in _score_fact(residuals)),
        f"Not drawn: {_left_over(residuals)}.",
    )


def _turned(residuals: Residuals, measured: MeasuredNoise) -> str:
    """What is known of inliers that are turned."""
    turned = int(residuals.inlier.sum() - residuals.upright.sum())
    beside = f" ({residuals.beside} about a point beside the origin)" if residuals.beside else ""
    return (
        f"{turned} inliers{beside} turned by more than {TURNED_DEG:g} deg are right if they look alike so, else wrong, "
        f"and are not fitted; {_turned_and_off(residuals, measured)} of them are farther off across the ray than "
        f"{100 * (1 - _RARE):g} % of the others"
    )


def _images(residuals: Residuals) -> int:
    return len(np.unique(residuals.where[:, :2], axis=0))


def _left_over(residuals: Residuals) -> str:
    per_image = residuals.surplus / _images(residuals)
    absent = f"{residuals.absent} of objects that are not in it"
    return f"{residuals.surplus} estimates left over, {per_image:.2g} per image, {absent}"


def _turned_and_off(residuals: Residuals, measured: MeasuredNoise) -> int:
    """How many turned inliers are off across the ray by more than `_RARE` of what was fitted to the others."""
    return int(
        (measured.shift_mm.cdf_across(residuals.across_mm[(residuals.inlier & ~residuals.upright)]) > 1.0 - _RARE).sum()
    )


def _score_fact(residuals: Residuals) -> list[tuple[str, str]]:
    """A line on how outliers depend on the score, if there are scores."""
    bands = outliers_by_score(residuals)
    higher = ", ".join(f"{100 * band.outliers:.0f} % from {band.least:.7g}" for band in bands[1:])
    return (
        [("by score", f"{100 * bands[0].outliers:.0f} % of the lowest fifth, {higher}, a fifth each")] if bands else []
    )


def _round_fact(residuals: Residuals) -> list[tuple[str, str]]:
    """A line on objects whose turn is not known."""
    named = ", ".join(map(str, residuals.round_objects))
    text = (
        f"objects {named} look alike turned by any angle about an axis, as estimates tell; their turns are not fitted"
    )
    return [("round", text)] if named else []


def _goodness(f: Figures) -> str:
    """How well one distribution fits."""
    p95 = PERCENTILES.index(95)
    return (
        f"p95 {f.fitted[p95]:.3g}, seen {f.observed[p95]:.3g} {f.unit}; Kolmogorov-Smirnov {f.distance:.3f}, "
        f"by chance below {f.by_chance:.3f}"
    )


def _bias(residuals: Residuals) -> tuple[Array, Array]:
    """Mean and its standard error of the shifts that are fitted, (3,) each, mm in the frame of the ray."""
    shift = residuals.shift_mm[residuals.upright]
    return shift.mean(axis=0), shift.std(axis=0) / np.sqrt(len(shift))


def _ratio(residuals: Residuals) -> float:
    """Median error along the ray over that across, of inliers."""
    return float(np.median(residuals.along_mm[residuals.inlier])) / max(
        float(np.median(residuals.across_mm[residuals.inlier])), 1e-9
    )


def _percentiles(values: Array) -> list[float]:
    return list(map(float, np.percentile(values, PERCENTILES)))


def _split_form(split: Split) -> dict[str, Any]:
    return {"limit": split.limit} | {
        name: {"scale": t.scale, "degrees_of_freedom": t.freedom if np.isfinite(t.freedom) else None}
        for name, t in {"across": split.across, "along": split.along}.items()
    }


def _tail_facts(
    name: str, directions: tuple[str, str], split: Split, unit: str, figures: Sequence[Figures]
) -> list[tuple[str, str]]:
    """One line for each direction: the tail, the standard deviation within the limit, and how well it fits."""
    facts = []
    for direction, tail, variance, f in zip(
        directions, (split.across, split.along), split.variances, figures, strict=True
    ):
        shape = f"Student t with {tail.freedom:.3g} degrees of freedom" if np.isfinite(tail.freedom) else "Gaussian"
        text = f"{direction}: scale {tail.scale:.3g} {unit}, {shape}; deviation {np.sqrt(variance):.3g} {unit} below "
        facts.append((name, text + f"{split.limit:g} {unit}; {_goodness(f)}"))
    return facts


_SEEN = "#9fb8d1"
_FITTED = "#a6341b"
_BINS = 40
_SHOWN = 0.995
"""Bins of a histogram, and up to which quantile it is drawn."""


@default_looks()
def draw_fit(residuals: Residuals, measured: MeasuredNoise, path: Path) -> None:
    """Write the picture as PNG: across the ray, along it, turns; above, histograms; below, quantiles."""
    from matplotlib.figure import Figure

    upright = residuals.upright
    shift = measured.shift_mm
    turn = measured.turn_deg
    columns = (
        ("across the ray [mm]", residuals.across_mm[upright], shift.cdf_across, shift.limit),
        ("along the ray, size [mm]", residuals.along_mm[upright], shift.cdf_along, shift.limit),
        ("turn [deg]", residuals.angle_deg[residuals.turn_known], turn.cdf_length, turn.limit),
    )
    figure = Figure(figsize=(11.0, 6.6), layout="constrained")
    axes = figure.subplots(2, 3)
    for column, (name, sizes, cdf, limit) in zip(axes.T, columns, strict=True):
        _histogram(column[0], name, sizes, cdf, limit)
        _quantiles(column[1], name, sizes, cdf, limit)
    axes[0, 0].set_ylabel("density")
    axes[1, 0].set_ylabel("seen")
    axes[0, 0].legend(frameon=False)
    source = measured.source if len(measured.source) <= 110 else measured.source[:107] + "..."
    rates = f"{100 * measured.outliers:.1f} % outliers, {100 * measured.missed:.1f} % missed"
    figure.suptitle(f"{source}\n{int(upright.sum())} inliers that are not turned; {rates}", fontsize=11)
    save_figure(figure, path, dpi=120)


def _histogram(axis: Any, name: str, sizes: Array, cdf: Callable[[Array], Array], limit: float) -> None:
    top = min(limit, max(float(np.quantile(sizes, _SHOWN)) * 1.05, 1e-3 * limit))
    edges = np.linspace(0.0, top, _BINS + 1)
    # a density of all sizes, also of those beyond the last bin: each counts 1 / (n * width of a bin)
    axis.hist(sizes, edges, weights=np.full(len(sizes), _BINS / (top * len(sizes))), color=_SEEN, label="seen")
    # the fitted density is the slope of its distribution
    fine = np.linspace(0.0, top, 401)
    axis.plot((fine[1:] + fine[:-1]) / 2, np.diff(cdf(fine)) / np.diff(fine), color=_FITTED, label="fitted")
    axis.set(xlim=(0.0, top), xlabel=name)
    axis.spines[["top", "right"]].set_visible(False)


def _quantiles(axis: Any, name: str, sizes: Array, cdf: Callable[[Array], Array], limit: float) -> None:
    """Every seen size against the one that the fit has at its rank; on the line they are alike."""
    grid = limit * np.linspace(0.0, 1.0, 2001) ** 2
    chance = np.maximum.accumulate(cdf(grid))
    # the i-th of n sizes has the share (i - 1/2) / n below it; where the fit has that share is read backwards
    rank = (np.arange(len(sizes)) + 0.5) / len(sizes)
    axis.plot([0.0, limit], [0.0, limit], color=_FITTED, linewidth=1.0)
    axis.plot(np.interp(rank, chance, grid), np.sort(sizes), ".", color="#33557a", markersize=3)
    axis.set(xlim=(0.0, limit), ylim=(0.0, limit), aspect="equal", xlabel=f"fitted, {name}")
    axis.spines[["top", "right"]].set_visible(False)
