"""How noisy the force and torque sensor at the wrist is, by the names that rows use.

`ideal`             no noise
`external`          0.1 N, 5 mNm: a good sensor between arm and hand, as of a Robotiq FT 300-S
`external-coarse`   0.2 N, 10 mNm: a less good one, as of an OnRobot HEX-E
`cobot`             3.5 N, 0.2 Nm: an arm's own, what is given as the precision of a Universal Robots UR5e
`0.5/0.02`          N and Nm; without the second one, 0.05 Nm to each N, as the external ones have

Each is the standard deviation of the white noise of one reading, per axis, at 1,000 readings a second. What of these
numbers could be checked is said in docs/guide/real-robot.md.
"""

import math
from types import MappingProxyType
from typing import NamedTuple

from apo_bench.errors import InputError, require, require_text, unknown


class WrenchNoise(NamedTuple):
    """Standard deviations of one reading, per axis."""

    force_n: float
    torque_nm: float


USUAL_WRENCH = "external"
_PRESETS = MappingProxyType(
    {
        "ideal": WrenchNoise(0.0, 0.0),
        "external": WrenchNoise(0.1, 0.005),
        "external-coarse": WrenchNoise(0.2, 0.01),
        "cobot": WrenchNoise(3.5, 0.2),
    }
)
_N_PER_NM = 20.0
_LARGEST = WrenchNoise(10.0, 5.0)
"""A touch ends by six standard deviations of what is felt, 13.5 N with such a sensor: with 14 N it was a collision."""


def wrench_noise(name: str) -> WrenchNoise:
    """The noise that a name stands for.

    Raises:
        InputError: No name, an unknown one, or a number that is not allowed.
    """
    require_text("wrench sensor", name)
    if name in _PRESETS:
        return _PRESETS[name]
    if not name[:1].isdigit() and name[:1] not in ("-", "+", ".", "/"):
        raise InputError(f"{unknown('wrench sensor', name, _PRESETS)} Or give its noise in N and Nm: 0.1/0.005.")
    try:
        force, *rest = (float(size) + 0.0 for size in name.split("/"))
        (torque,) = rest or [force / _N_PER_NM]
    except ValueError:
        force = torque = math.nan
    require(
        0.0 <= force <= _LARGEST.force_n and 0.0 <= torque <= _LARGEST.torque_nm,
        f"the wrench sensor '{name}' was given; standard deviations from 0 to {_LARGEST.force_n:g} N and from 0 to "
        f"{_LARGEST.torque_nm:g} Nm are allowed (with more N a touch is a collision before it is felt): 0.1/0.005, "
        f"or a name: {', '.join(_PRESETS)}.",
    )
    return WrenchNoise(force, torque)


def checked_wrench(name: str) -> str:
    """A sensor as rows spell it: by its name where it has one, else by numbers that read back as they are.

    Raises:
        InputError: As in `wrench_noise`.
    """
    noise = wrench_noise(name)
    known = next((preset for preset, its in _PRESETS.items() if its == noise), None)
    return known or "/".join(repr(x).removesuffix(".0") for x in noise)
