"""Histograms of a noise model's errors, with the Gaussian that its observations state."""

from pathlib import Path
from typing import Any

import numpy as np

from apo_bench.geometry.arrays import Array
from apo_bench.io.figures import default_looks
from apo_bench.show.noise_card import PANEL_UNITS, PANELS, Drawn

_SIZE_INCH = (9.0, 2.3)
_BINS = 49
_REACH = 6.0
"""Half width of a panel in stated standard deviations; what is beyond is counted in the outermost bins."""
_COLOR = "#4477aa"


@default_looks()
def draw_histogram(drawn: Drawn, path: Path) -> None:
    """Write the four panels as PNG: error across and along the ray, tilt, turn about the ray; densities are log."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=_SIZE_INCH, layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots(1, len(PANELS))
    for i, (axis, name, unit) in enumerate(zip(axes, PANELS, PANEL_UNITS, strict=True)):
        _panel(axis, drawn.errors[:, i], float(drawn.stated[i]))
        axis.set_xlabel(f"{name} [{unit}]", fontsize=9)
    axes[0].set_ylabel("density", fontsize=9)
    figure.savefig(path, dpi=90)


def _panel(axis: Any, errors: Array, stated: float) -> None:
    sigma = stated or 1.0
    edges = np.linspace(-_REACH * sigma, _REACH * sigma, _BINS + 1)
    inside = np.clip(errors, edges[0], edges[-1])
    axis.hist(inside, edges, density=True, color=_COLOR, alpha=0.75)
    x = np.linspace(edges[0], edges[-1], 241)
    normal = np.exp(-0.5 * (x / sigma) ** 2) / (sigma * np.sqrt(2.0 * np.pi))
    axis.plot(x, normal, color="black", linewidth=1.0)
    axis.set_yscale("log")
    axis.set_ylim(1e-4 / sigma, 1.5 / sigma)
    axis.tick_params(labelsize=8)
    axis.spines[["top", "right"]].set_visible(False)
