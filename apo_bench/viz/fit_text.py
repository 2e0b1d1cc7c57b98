"""A fitted noise model as one JSON object, as lines, and as notes of a noise file."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from apo_bench.geometry import Array
from apo_bench.io import align_columns
from apo_bench.perception.observation.fitting.fit import PERCENTILES, GoodnessOfFit, count_outliers_by_score
from apo_bench.perception.observation.models import TURNED_DEG, MeasuredNoise, Residuals, TruncatedTails
from apo_bench.viz.form_text import list_facts

_SCHEMA = "apo-bench/noise-fit/2"
_RARE = 0.01  # a turned part whose shift has a smaller tail probability than this is counted as off as well
_NOTED = ("parts", "images", "distance_mm", "found", "left_over", "turned", "turned_and_off", "round_objects")
"""Keys of a form that the notes of a noise file state."""


def make_fit_form(residuals: Residuals, measured: MeasuredNoise, figures: Sequence[GoodnessOfFit]) -> dict[str, Any]:
    """Return counts and fits as a JSON object: mm and degrees; degrees of freedom are null for a Gaussian."""
    inlier = residuals.is_inlier
    turned = inlier & ~residuals.is_upright  # inliers with a rotation error beyond TURNED_DEG
    shift = residuals.shift_mm[residuals.is_upright]
    across = max(float(np.median(residuals.across_mm[inlier])), 1e-9)  # never 0, since it is a divisor below
    return {
        "schema": _SCHEMA,
        "source": measured.source,
        "parts": len(residuals.where),
        "images": len(np.unique(residuals.where[:, :2], axis=0)),
        "distance_mm": residuals.distance_mm,
        "found": int(residuals.is_estimated.sum()),
        "missed_rate": measured.missed,
        "left_over": residuals.surplus,
        "of_absent_objects": residuals.absent,
        "inliers": int(inlier.sum()),
        "outlier_rate": measured.outliers,
        "outlier_farthest_mm": measured.farthest_mm,
        "outliers_by_score": [band._asdict() for band in count_outliers_by_score(residuals)],
        "turned": int(turned.sum()),
        "turned_and_off": int((measured.shift_mm.cdf_across(residuals.across_mm[turned]) > 1.0 - _RARE).sum()),
        "round_objects": list(residuals.round_objects),
        "bias_mm": shift.mean(axis=0).tolist(),
        "bias_standard_error_mm": (shift.std(axis=0) / np.sqrt(len(shift))).tolist(),
        "along_over_across": float(np.median(residuals.along_mm[inlier])) / across,
        "percentiles": list(PERCENTILES),
        "inlier_across_mm": _list_percentiles(residuals.across_mm[inlier]),
        "inlier_along_mm": _list_percentiles(residuals.along_mm[inlier]),
        "inlier_turn_deg": _list_percentiles(residuals.angle_deg[inlier]),
        "inlier_turn_by_trace_deg": _list_percentiles(residuals.trace_deg[inlier]),
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
        "shift_mm": _make_split_form(measured.shift_mm),
        "turn_deg": _make_split_form(measured.turn_deg),
    }


def format_fit(form: Mapping[str, Any]) -> list[str]:
    """Format a form of `make_fit_form` as lines: facts, a table of percentiles, and the goodness of fit."""
    inliers = [key for key in form if key.startswith("inlier_")]
    facts = list_facts(form, ("schema", "percentiles", "fit", *inliers))
    table = [("", "", *(f"p{p}" for p in form["percentiles"]))]
    for name, of in form["fit"].items():
        for head, word in ((f"{name} [{of['unit']}]", "observed"), ("", "fitted")):
            table.append((head, word, *(f"{value:.2f}" for value in of[word])))
    return [*align_columns(facts), "", *align_columns(table), "", *_format_goodness_of_fit(form)]


def list_fit_notes(form: Mapping[str, Any]) -> tuple[str, ...]:
    """Return the notes that a noise file states about its fit, one line each."""
    return (
        "Level 1 is as measured: mm and degrees, Student t, none beyond the limit.",
        f"Inliers that are turned by more than {TURNED_DEG:g} deg are not fitted: symmetries are not known.",
        *map(": ".join, list_facts({key: form[key] if form[key] != [] else "none" for key in _NOTED})),
        *_format_goodness_of_fit(form),
    )


def _format_goodness_of_fit(form: Mapping[str, Any]) -> list[str]:
    """Return a line per fit: its Kolmogorov-Smirnov distance, and the 95 % quantile of that for a correct fit."""
    return [
        f"{name}: Kolmogorov-Smirnov {of['kolmogorov_smirnov']:.3f}, by chance below "
        f"{of['kolmogorov_smirnov_by_chance']:.3f}"
        for name, of in form["fit"].items()
    ]


def _list_percentiles(values: Array) -> list[float]:
    return list(map(float, np.percentile(values, PERCENTILES)))


def _make_split_form(split: TruncatedTails) -> dict[str, Any]:
    """Return the fitted distributions across and along the ray as a JSON object."""
    return {"limit": split.limit} | {
        name: {"scale": t.scale, "degrees_of_freedom": t.freedom if np.isfinite(t.freedom) else None}
        for name, t in {"across": split.across, "along": split.along}.items()
    }
