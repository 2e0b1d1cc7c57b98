"""What is wrong with the robot itself, by the names that rows use: kinds with their standard deviations.

`none`              nothing
`hand_eye:1/0.2`    where the camera believes the robot's base to be: mm per axis, degrees per axis
`joints:0.05`       the zero of every joint: degrees
`tool:0.5`          where the tip is on the hand: mm per axis
`in_hand:0.5/1`     how a part slips in the hand when it was taken: mm along the pads, degrees about their normal

Several are joined by `+`. A robot that feels is told how wrong it is (its stated error):

`drawn`             the standard deviations that its error is drawn with
`unstated`          nothing; it assumes what is usual
`none`, `tool:0.5`  as above, whatever is drawn

How noisy the force and torque sensor at the wrist is, by the names that rows use.

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

NO_ROBOT_ERROR = "none"
MATCHED = "matched"
_UNKNOWN = "unknown"
_LARGEST = 20.0
"""Standard deviation, [mm] or [deg]."""
_UNITS = {"hand_eye": ("mm", "degrees"), "joints": ("degrees",), "tool": ("mm",), "in_hand": ("mm", "degrees")}
"""Kind -> what its numbers are; the second one may be left out and is 0 then."""


class Sigmas(NamedTuple):
    """Standard deviations, [mm] and [deg]."""

    hand_eye: tuple[float, float] = (0.0, 0.0)
    joints_deg: float = 0.0
    tool_mm: float = 0.0
    in_hand: tuple[float, float] = (0.0, 0.0)


def robot_sigmas(name: str, called: str = "robot error") -> Sigmas:
    """The standard deviations that a name stands for.

    Args:
        called: What it is, for complaints.

    Raises:
        InputError: An unknown kind, one that is there twice, or a number that is not allowed.
    """
    require_text(called, name)
    sigmas: dict[str, tuple[float, float]] = {}
    for entry in name.split("+") if name != NO_ROBOT_ERROR else ():
        kind, _, sizes = entry.partition(":")
        if kind not in _UNITS:
            raise InputError(unknown(f"kind of {called}", kind, (NO_ROBOT_ERROR, *_UNITS)))
        require(kind not in sigmas, f"the {called} '{name}' was given, which has {kind} twice; say it once.")
        sigmas[kind] = _numbers(f"{called} '{name}'", kind, sizes)
    hand_eye, joints, tool, in_hand = (sigmas.get(kind, (0.0, 0.0)) for kind in _UNITS)
    return Sigmas(hand_eye, joints[0], tool[0], in_hand)


def checked_robot_error(name: str) -> str:
    """The robot's errors as rows spell them, `none` if all are zero.

    Raises:
        InputError: As in `robot_sigmas`.
    """
    return _spelled_error(robot_sigmas(name))


def checked_assumed_robot_error(name: str) -> str:
    """A stated error as rows spell it.

    Raises:
        InputError: It is neither `drawn` nor `unstated`, nor what `robot_sigmas` takes.
    """
    require_text("stated error", name)
    if name in (MATCHED, _UNKNOWN):
        return name
    if name != NO_ROBOT_ERROR and any(entry.partition(":")[0] not in _UNITS for entry in name.split("+")):
        raise InputError(unknown("stated error", name, (MATCHED, _UNKNOWN, NO_ROBOT_ERROR, *_UNITS)))
    return _spelled_error(robot_sigmas(name, "stated error"))


def _spelled_error(sigmas: Sigmas) -> str:
    hand_eye, joints_deg, tool_mm, in_hand = sigmas
    sizes = {"hand_eye": hand_eye, "joints": (joints_deg,), "tool": (tool_mm,), "in_hand": in_hand}
    return "+".join(f"{kind}:{_spelled(size)}" for kind, size in sizes.items() if any(size)) or NO_ROBOT_ERROR


def assumed_error(assumed_robot_error: str, robot_error: str) -> str | None:
    """How wrong a robot is said to be, as in `robot_sigmas`; None if nobody says.

    Args:
        stated_error, robot_error: As in rows.
    """
    if assumed_robot_error == _UNKNOWN:
        return None
    return robot_error if assumed_robot_error == MATCHED else assumed_robot_error


def _numbers(said: str, kind: str, sizes: str) -> tuple[float, float]:
    """The one or two numbers of a kind; the second is 0 if it is left out."""
    units = _UNITS[kind]
    try:
        numbers = tuple(float(size) + 0.0 for size in sizes.split("/"))
    except ValueError:
        numbers = (math.nan,)
    if len(numbers) > len(units) or not all(0.0 <= size <= _LARGEST for size in numbers):
        example = f"{kind}:{'/'.join(('0.5', '0.1')[: len(units)])}"
        raise InputError(
            f"the {said} was given; standard deviations in {' and '.join(units)} from 0 to {_LARGEST:g} "
            f"are allowed: {example}."
        )
    first, second = (*numbers, 0.0)[:2]
    return first, second


def _spelled(size: tuple[float, ...]) -> str:
    """`1`, or `1/0.2`: numbers that read back as they are."""
    needed = size[:1] if len(size) > 1 and not size[1] else size
    return "/".join(repr(x).removesuffix(".0") for x in needed)


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
_N_PER_NM = 20.0
_MOST = FtNoise(10.0, 5.0)
"""A touch ends by six standard deviations of what is felt, 13.5 N with such a sensor: with 14 N it was a collision."""


def ft_noise(name: str) -> FtNoise:
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
        0.0 <= force <= _MOST.force_n and 0.0 <= torque <= _MOST.torque_nm,
        f"the wrench sensor '{name}' was given; standard deviations from 0 to {_MOST.force_n:g} N and from 0 to "
        f"{_MOST.torque_nm:g} Nm are allowed (with more N a touch is a collision before it is felt): 0.1/0.005, "
        f"or a name: {', '.join(_PRESETS)}.",
    )
    return FtNoise(force, torque)


def checked_ft_sensor(name: str) -> str:
    """A sensor as rows spell it: by its name where it has one, else by numbers that read back as they are.

    Raises:
        InputError: As in `wrench_noise`.
    """
    noise = ft_noise(name)
    known = next((preset for preset, its in _PRESETS.items() if its == noise), None)
    return known or "/".join(repr(x).removesuffix(".0") for x in noise)
