"""Names of wrench sensors: spelled in one way, and one sentence where there is no such sensor."""

from __future__ import annotations

import pytest

from apo_bench import InputError
from apo_bench.records import normalise_ft_sensor, parse_ft_noise


@pytest.mark.parametrize(
    ("given", "spelled", "noise"),
    [("ideal", "ideal", (0.0, 0.0)), ("0.10", "wrist", (0.1, 0.005)), (".2/.01", "wrist-coarse", (0.2, 0.01))],
)
def test_a_name_is_spelled_in_one_way_that_reads_back(given: str, spelled: str, noise: tuple[float, float]) -> None:
    assert normalise_ft_sensor(given) == spelled == normalise_ft_sensor(spelled)
    assert parse_ft_noise(given) == noise == parse_ft_noise(spelled)


@pytest.mark.parametrize("given", ["writs", "-1"])
def test_another_sensor_is_refused(given: str) -> None:
    with pytest.raises(InputError, match="force-torque sensor '"):
        normalise_ft_sensor(given)
