"""Statistics of the columns and images of a LeRobot data set, under LeRobot's names, to normalise them by."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from apo_bench.geometry import Array, Ints

_QUANTILES = {f"q{round(100 * q):02d}": q for q in (0.01, 0.10, 0.50, 0.90, 0.99)}
_LEVELS = np.arange(256) / 255
"""Values of a colour, as LeRobot reads them."""


def compute_statistics(column: Array) -> dict[str, list[float]]:
    """Return the statistics of each number of a column, (T,) or (T, k)."""
    x = np.asarray(column, dtype=np.float64).reshape(len(column), -1)
    found = {"min": x.min(axis=0), "max": x.max(axis=0), "mean": x.mean(axis=0), "std": x.std(axis=0)}
    found |= {name: np.quantile(x, q, axis=0) for name, q in _QUANTILES.items()}
    return {**{name: values.tolist() for name, values in found.items()}, "count": [len(x)]}


def count_colours(images: NDArray[np.uint8]) -> Ints:
    """Return how often red, green and blue have each of 256 values in images, (*, 3), as (3, 256)."""
    return np.array([np.bincount(images[..., channel].ravel(), minlength=256) for channel in range(3)])


def summarise_colours(colours: Ints, frames: int) -> dict[str, Any]:
    """Return the statistics of red, green and blue, from 0 to 1, each (3, 1, 1).

    Args:
        colours: Of all images, from `count_colours`.
        frames: Number of images.
    """
    shares = colours / colours.sum(axis=1, keepdims=True)
    mean = shares @ _LEVELS
    found = {"mean": mean, "std": np.sqrt(np.maximum(shares @ _LEVELS**2 - mean**2, 0.0))}
    for name, q in {"min": 0.0, "max": 1.0, **_QUANTILES}.items():
        found[name] = np.array([np.quantile(_LEVELS, q, weights=each, method="inverted_cdf") for each in shares])
    return {**{name: values.reshape(3, 1, 1).tolist() for name, values in found.items()}, "count": [frames]}
