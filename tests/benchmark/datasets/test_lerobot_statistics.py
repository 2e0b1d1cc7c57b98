"""Statistics of a LeRobot data set: those of images are the same from counts of colours as from all pixels."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.typing import NDArray

from apo_bench.benchmark.datasets.lerobot_statistics import compute_statistics, count_colours, summarise_colours


@given(arrays(np.uint8, st.tuples(st.integers(1, 3), st.integers(1, 4), st.integers(1, 4), st.just(3))))
def test_counts_give_the_statistics_of_the_pixels(images: NDArray[np.uint8]) -> None:
    found = summarise_colours(count_colours(images), len(images))
    pixels = images.reshape(-1, 3) / 255
    for name in ("min", "max", "mean", "std"):
        assert np.shape(found[name]) == (3, 1, 1)
        # counts lose half of the digits in a standard deviation near zero
        assert np.ravel(found[name]) == pytest.approx(getattr(pixels, name)(axis=0), abs=1e-7)
    for name, q in (("q01", 0.01), ("q50", 0.5), ("q99", 0.99)):
        below = (pixels <= np.ravel(found[name]) + 1e-9).mean(axis=0)
        assert (below >= q - 1e-9).all()
    assert found["count"] == [len(images)]


def test_a_column_has_the_statistics_of_each_number() -> None:
    found = compute_statistics(np.array([[0.0, 1.0], [2.0, 1.0], [4.0, 1.0]]))
    assert (found["mean"], found["min"], found["max"]) == ([2.0, 1.0], [0.0, 1.0], [4.0, 1.0])
    assert (found["q50"], found["count"]) == ([2.0, 1.0], [3])
