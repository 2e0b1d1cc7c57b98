"""How round faces lie to each other: as formulas say, the same from both sides and in every world."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from apo_bench.geometry import Face, RoundFace, compute_shares, pose
from apo_bench.geometry.mating import measure_mate
from tests.round_parts import cone, cylinder, rim, square, up
from tests.scenes import mm

PEG = cylinder("wall", 5, (-25, 25))
BORE = cylinder("bore", 5, (0, 20), hole=True, fit=True)
CONE = cone("cone", (3, 9), (0, 6))
SINK = cone("sink", (3, 9), (-6, 0), hole=True)
RIM = rim("rim", 5, 0)
EDGE = rim("edge", 5, 0, hole=False, upwards=False)
TABLE = up("top", square(100, 0))
HERE = np.eye(4)


@pytest.mark.parametrize(
    ("T", "gap_mm", "angle_deg", "length_mm"),
    [
        (mm(0.3, 0.4, 35), 0.5, 0, 10),
        (mm(0, 0, 10, (1, 0, 0)), 10 * np.tan(np.radians(1)), 1, 20),
        (mm(0.2, 0, 60), 0.2, 0, 0),
    ],
)
def test_a_shaft_in_a_hole(T: np.ndarray, gap_mm: float, angle_deg: float, length_mm: float) -> None:
    found = measure_mate(PEG, T, BORE, HERE)
    assert 1e3 * found.gap_m == pytest.approx(gap_mm, abs=1e-9)
    assert np.degrees(found.angle_rad) == pytest.approx(angle_deg, abs=1e-9)
    assert 1e3 * found.length_m == pytest.approx(length_mm, abs=1e-9)
    assert bool(found.common) == (length_mm > 0)


@pytest.mark.parametrize(
    ("T", "heights_mm", "angle_deg", "length_mm"),
    [
        (mm(0, 0, 5, (0, 90, 0)), (0, 0), 0, 50),
        (mm(90, 0, 5.2, (0, 90, 0)), (0.2, 0.2), 0, 35),
        (mm(0, 0, 5, (0, 89, 0)), (-25 * np.sin(np.radians(1)), 25 * np.sin(np.radians(1))), 1, 50),
        (mm(0, 0, 30), (0, 50), 90, 0),
    ],
)
def test_a_shaft_on_a_plane(T: np.ndarray, heights_mm: tuple[float, float], angle_deg: float, length_mm: float) -> None:
    for found in (measure_mate(PEG, T, TABLE, HERE), measure_mate(TABLE, HERE, PEG, T)):
        assert 1e3 * found.offsets[:, 2] == pytest.approx(heights_mm, abs=1e-9)
        assert np.degrees(found.angle_rad) == pytest.approx(angle_deg, abs=1e-9)
        assert 1e3 * found.length_m == pytest.approx(length_mm, abs=1e-9)
        assert bool(found.common) == (length_mm > 0)


@pytest.mark.parametrize(
    ("T", "gap_mm", "angle_deg"),
    [
        (mm(0, 0, -5.9), 0.1 * np.sqrt(0.5), 0),
        (mm(0, 0, -6.2), 0.2 * np.sqrt(0.5), 0),
        (mm(0.3, 0, -6), 0.3, 0),
        (mm(0, 0, 0, (180, 0, 0)), 0, 180),
    ],
)
def test_a_cone_in_a_countersink(T: np.ndarray, gap_mm: float, angle_deg: float) -> None:
    if angle_deg == 0:
        assert measure_mate(CONE, T, SINK, HERE).rise_m == pytest.approx(T[2, 3] + 6e-3, abs=1e-9)
    for found in (measure_mate(CONE, T, SINK, HERE), measure_mate(SINK, HERE, CONE, T)):
        assert 1e3 * found.gap_m == pytest.approx(gap_mm, abs=1e-9)
        assert np.degrees(found.angle_rad) == pytest.approx(angle_deg, abs=1e-9)


@pytest.mark.parametrize(("x", "z", "gap_mm"), [(0, -2, 0), (0, -1.8, 0.2 * np.sqrt(0.5)), (0.3, -2, 0.3)])
def test_a_cone_on_the_rim_of_a_hole_and_the_rim_of_a_shaft_in_a_countersink(x: float, z: float, gap_mm: float) -> None:
    """Rims of 5 mm where the cones are 3 to 9 mm wide: 2 mm above the narrow end."""
    for found in (measure_mate(CONE, mm(x, 0, z), RIM, HERE), measure_mate(RIM, HERE, CONE, mm(x, 0, z))):
        assert 1e3 * found.gap_m == pytest.approx(gap_mm, abs=1e-9)
        assert found.common
    for found in (measure_mate(EDGE, mm(x, 0, z - 2), SINK, HERE), measure_mate(SINK, HERE, EDGE, mm(x, 0, z - 2))):
        assert 1e3 * found.gap_m == pytest.approx(gap_mm, abs=1e-9)
        assert found.common
    assert np.degrees(measure_mate(CONE, mm(0, 0, 0, (180, 0, 0)), RIM, HERE).angle_rad) == pytest.approx(180)


PAIRS: list[tuple[Face | RoundFace, Face | RoundFace, float]] = [
    (PEG, BORE, 10),
    (PEG, TABLE, 5),
    (CONE, SINK, -6),
    (CONE, RIM, -2),
    (EDGE, SINK, -4),
]


@given(st.integers(0, 10**6), st.sampled_from(PAIRS))
@settings(max_examples=40, deadline=None)
def test_the_world_does_not_matter(seed: int, pair: tuple[Face | RoundFace, Face | RoundFace, float]) -> None:
    rng = np.random.default_rng(seed)
    a, b, z = pair
    lying = (0, 90, 0) if b is TABLE else (0, 0, 0)
    T = mm(0, 0, z, lying) @ pose.exp(rng.standard_normal(6) * np.repeat([1e-3, 0.02], 3))
    W = pose.exp(rng.standard_normal(6))
    here = measure_mate(a, T, b, HERE)
    there = measure_mate(a, W @ T, b, W)
    for name in ("gap_m", "angle_rad", "rise_m", "length_m"):
        assert getattr(there, name) == pytest.approx(getattr(here, name), abs=1e-9)
    assert there.offsets == pytest.approx(here.offsets @ W[:3, :3].T, abs=1e-9)
    assert compute_shares([there.common], [here.common]) == pytest.approx([1.0], abs=1e-6)
