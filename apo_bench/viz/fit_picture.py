"""A picture of how well a fitted noise model agrees with residuals: histograms and quantile-quantile plots."""

import textwrap
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from apo_bench.geometry import Array
from apo_bench.io import save_figure, use_figure_style
from apo_bench.perception.observation.models import MeasuredNoise, Residuals

_OBSERVED = "#9fb8d1"
_FITTED = "#a6341b"
_BINS = 40
_LETTERS = 120  # most letters in a line of the title
_SHOWN = 0.995  # quantile up to which a histogram is drawn


@use_figure_style()
def draw_fit(residuals: Residuals, measured: MeasuredNoise, path: Path) -> None:
    """Write a PNG picture with a column each for errors across the ray, along the ray, and of rotation.

    The upper row has histograms with fitted densities, the lower row observed against fitted quantiles.
    """
    from matplotlib.figure import Figure

    upright = residuals.is_upright
    shift = measured.shift_mm
    turn = measured.turn_deg
    columns = (
        ("across the ray [mm]", residuals.across_mm[upright], shift.cdf_across, shift.limit),
        ("along the ray, size [mm]", residuals.along_mm[upright], shift.cdf_along, shift.limit),
        ("turn [deg]", residuals.angle_deg[residuals.has_rotation_error], turn.cdf_length, turn.limit),
    )
    figure = Figure(figsize=(11.0, 6.6), layout="constrained")
    axes = figure.subplots(2, 3)
    for column, (name, sizes, cdf, limit) in zip(axes.T, columns, strict=True):
        _draw_histogram(column[0], name, sizes, cdf, limit)
        _draw_quantiles(column[1], name, sizes, cdf, limit)
    axes[0, 0].set_ylabel("density")
    axes[1, 0].set_ylabel("observed")
    axes[0, 0].legend(frameon=False)
    rates = f"{100 * measured.outliers:.1f} % outliers, {100 * measured.missed:.1f} % missed"
    title = f"{textwrap.fill(measured.source, _LETTERS)}\n{int(upright.sum())} inliers that are not turned; {rates}"
    figure.suptitle(title, fontsize=11)
    save_figure(figure, path, dpi=120)


def _draw_histogram(axis: Any, name: str, sizes: Array, cdf: Callable[[Array], Array], limit: float) -> None:
    """Draw observed sizes as a histogram, with the density of the fitted distribution `cdf` up to `limit`."""
    # the cut tail may be long, but the axis has a width even if all sizes are 0
    top = min(limit, max(float(np.quantile(sizes, _SHOWN)) * 1.05, 1e-3 * limit))
    # a bar of m sizes has height m / (n * bin width); n counts the sizes beyond the last bin too
    weights = np.full(len(sizes), _BINS / (top * len(sizes)))
    axis.hist(sizes, np.linspace(0.0, top, _BINS + 1), weights=weights, color=_OBSERVED, label="observed")
    # the fitted density is the numerical derivative of the fitted distribution
    fine = np.linspace(0.0, top, 401)
    axis.plot((fine[1:] + fine[:-1]) / 2, np.diff(cdf(fine)) / np.diff(fine), color=_FITTED, label="fitted")
    axis.set(xlim=(0.0, top), xlabel=name)


def _draw_quantiles(axis: Any, name: str, sizes: Array, cdf: Callable[[Array], Array], limit: float) -> None:
    """Plot observed quantiles against fitted quantiles; points on the diagonal agree."""
    grid = limit * np.linspace(0.0, 1.0, 2001) ** 2
    # of n sizes the i-th has the cumulative probability (i - 1/2) / n; interpolation inverts the fitted distribution
    rank = (np.arange(len(sizes)) + 0.5) / len(sizes)
    fitted = np.interp(rank, np.maximum.accumulate(cdf(grid)), grid)
    axis.plot([0.0, limit], [0.0, limit], color=_FITTED, linewidth=1.0)
    axis.plot(fitted, np.sort(sizes), ".", color="#33557a", markersize=3)
    axis.set(xlim=(0.0, limit), ylim=(0.0, limit), aspect="equal", xlabel=f"fitted, {name}")
