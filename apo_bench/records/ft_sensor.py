"""Names of the noise of the force-torque sensor at the wrist, as records have them.

`ideal`         no noise
`wrist`         0.1 N, 5 mNm: a good sensor between arm and hand, as of a Robotiq FT 300-S
`wrist-coarse`  0.2 N, 10 mNm: a coarser one, as of an OnRobot HEX-E
`joint-torque`  3.5 N, 0.2 Nm: an arm's own, the stated precision of a Universal Robots UR5e
`0.5/0.02`      N and Nm; the default torque noise is 0.05 Nm per N

Each is the standard deviation of the white noise of one reading, per axis, at 1,000 readings a second.
docs/guide/real-robot.md states the sources of these numbers.
"""

import math
from types import MappingProxyType
from typing import NamedTuple

from apo_bench.errors import require, require_known, require_text


class FtNoise(NamedTuple):
    """Standard deviations of one reading, per axis."""

    force_n: float
    torque_nm: float


USUAL_FT_SENSOR = "wrist"
_PRESETS = MappingProxyType(
    {
        "ideal": FtNoise(0.0, 0.0),
        "wrist": FtNoise(0.1, 0.005),
        "wrist-coarse": FtNoise(0.2, 0.01),
        "joint-torque": FtNoise(3.5, 0.2),
    }
)
_N_PER_NM = 20.0  # default ratio of force noise to torque noise
_MOST = FtNoise(10.0, 5.0)  # largest standard deviations
"""A touch ends at six standard deviations of a reading after the filter, 13.5 N here; 14 N counts as a collision."""


def parse_ft_noise(name: str) -> FtNoise:
    """Return the noise of a sensor by its name, or from numbers.

    Raises:
        InputError: The name is unknown, or a number is not allowed.
    """
    require_text("force-torque sensor", name)
    if name in _PRESETS:
        return _PRESETS[name]
    if name[:1].isalpha():
        require_known("force-torque sensor", name, _PRESETS, rest=" Or give its noise in N and Nm: 0.1/0.005.")
    try:
        force, *rest = (float(size) + 0.0 for size in name.split("/"))
        (torque,) = rest or [force / _N_PER_NM]  # a second number is optional
    except ValueError:
        force = torque = math.nan
    require(
        0.0 <= force <= _MOST.force_n and 0.0 <= torque <= _MOST.torque_nm,
        f"the force-torque sensor '{name}' was given; standard deviations from 0 to {_MOST.force_n:g} N and from 0 to "
        f"{_MOST.torque_nm:g} Nm are allowed: 0.1/0.005, or a name: {', '.join(_PRESETS)}.",
    )
    return FtNoise(force, torque)


def normalise_ft_sensor(name: str) -> str:
    """Return the canonical name of a sensor: the preset with this noise, else numbers that are read back exactly.

    Raises:
        InputError: As in `parse_ft_noise`.
    """
    noise = parse_ft_noise(name)
    known = next((preset for preset, its in _PRESETS.items() if its == noise), None)
    return known or "/".join(repr(x).removesuffix(".0") for x in noise)
