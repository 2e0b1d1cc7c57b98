"""Names of robot errors: kinds of error with their standard deviations.

`none`              no error
`hand_eye:1/0.2`    pose of the robot's base in the camera's frame: mm per axis, degrees per axis
`joints:0.05`       zero of every joint: degrees
`tool:0.5`          position of the tip on the hand: mm per axis
`in_hand:0.5/1`     pose of a part in the hand after the grasp: mm along the pads, degrees about their normal
`sag:0.5`           height of the tip, lost since joints yield to the weight of the arm unseen by encoders: mm
`base_tilt:0.1`     tilt of the base about its foot: degrees about each level axis
`finger:0.5`        one finger shorter than the other in the closing direction: mm
`ft_drift:1`        drift of the force-torque sensor: N a minute per axis, and 0.05 Nm a minute per N

Several kinds are joined by `+`. A robot that probes assumes such an error:

`matched`           the standard deviations that its error is drawn with
`unknown`           usual ones
`none`, `tool:0.5`  as above, whatever is drawn
"""

import math
from typing import NamedTuple

from apo_bench.errors import require, require_known, require_text

NO_ROBOT_ERROR = "none"
MATCHED = "matched"
_UNKNOWN = "unknown"
_LARGEST = 20.0
"""Largest standard deviation, [mm] or [deg]."""
_UNITS = {
    "hand_eye": ("mm", "degrees"),
    "joints": ("degrees",),
    "tool": ("mm",),
    "in_hand": ("mm", "degrees"),
    "sag": ("mm",),
    "base_tilt": ("degrees",),
    "finger": ("mm",),
    "ft_drift": ("N a minute",),
}
"""Kind -> units of its numbers; a second number is optional, with default 0."""


class Sigmas(NamedTuple):
    """Standard deviations of each kind; pairs are [mm] and [deg]."""

    hand_eye: tuple[float, float] = (0.0, 0.0)
    joints_deg: float = 0.0
    tool_mm: float = 0.0
    in_hand: tuple[float, float] = (0.0, 0.0)
    sag_mm: float = 0.0
    base_tilt_deg: float = 0.0
    finger_mm: float = 0.0
    ft_drift_n: float = 0.0
    """A minute."""


def parse_robot_error(name: str, called: str = "robot error") -> Sigmas:
    """Parse the name of a robot error.

    Args:
        called: Name of the setting, for the message.

    Raises:
        InputError: A kind is unknown or occurs twice, or a number is not allowed.
    """
    require_text(called, name)
    sigmas: dict[str, tuple[float, float]] = {}
    for entry in name.split("+") if name != NO_ROBOT_ERROR else ():
        kind, _, sizes = entry.partition(":")
        require_known(f"kind of {called}", kind, (NO_ROBOT_ERROR, *_UNITS))
        require(kind not in sigmas, f"the {called} '{name}' was given, which has {kind} twice; state it once.")
        sigmas[kind] = _read_numbers(f"{called} '{name}'", kind, sizes)
    hand_eye, joints, tool, in_hand, *others = (sigmas.get(kind, (0.0, 0.0)) for kind in _UNITS)
    return Sigmas(hand_eye, joints[0], tool[0], in_hand, *(size for size, _ in others))


def normalise_robot_error(name: str) -> str:
    """Return the canonical name of a robot error; `none` if all numbers are zero.

    Raises:
        InputError: As in `parse_robot_error`.
    """
    return _spell_sigmas(parse_robot_error(name))


def normalise_assumed_robot_error(name: str) -> str:
    """Return the canonical name of an assumed robot error.

    Raises:
        InputError: The name is neither `matched` nor `unknown`, nor one that `parse_robot_error` takes.
    """
    require_text("assumed robot error", name)
    if name in (MATCHED, _UNKNOWN):
        return name
    if ":" not in name:
        require_known("assumed robot error", name, (MATCHED, _UNKNOWN, NO_ROBOT_ERROR, *_UNITS))
    return _spell_sigmas(parse_robot_error(name, "assumed robot error"))


def parse_assumed_error(assumed_robot_error: str, robot_error: str) -> str | None:
    """Return the error that a robot assumes, as in `parse_robot_error`; None means the usual one.

    Args:
        assumed_robot_error, robot_error: As in records.
    """
    if assumed_robot_error == _UNKNOWN:
        return None
    return robot_error if assumed_robot_error == MATCHED else assumed_robot_error


def _read_numbers(given: str, kind: str, sizes: str) -> tuple[float, float]:
    """Parse the one or two numbers of a kind; the second is 0 by default."""
    units = _UNITS[kind]
    try:
        numbers = tuple(float(size) + 0.0 for size in sizes.split("/"))
    except ValueError:
        numbers = (math.nan,)
    example = f"{kind}:{'/'.join(('0.5', '0.1')[: len(units)])}"
    require(
        len(numbers) <= len(units) and all(0.0 <= size <= _LARGEST for size in numbers),
        f"the {given} was given; standard deviations in {' and '.join(units)} from 0 to {_LARGEST:g} are allowed: "
        f"{example}.",
    )
    first, second = (*numbers, 0.0)[:2]
    return first, second


def _spell_sigmas(sigmas: Sigmas) -> str:
    """Return the canonical name of standard deviations, without kinds that are zero."""
    kinds = zip(_UNITS, ((*s, 0.0)[:2] if isinstance(s, tuple) else (s, 0.0) for s in sigmas), strict=True)
    return "+".join(f"{kind}:{spell_sizes(sizes)}" for kind, sizes in kinds if any(sizes)) or NO_ROBOT_ERROR


def spell_sizes(sizes: tuple[float, float]) -> str:
    """Format `1`, or `1/0.2`: numbers that are read back exactly."""
    needed = sizes if sizes[1] else sizes[:1]
    return "/".join(repr(x).removesuffix(".0") for x in needed)
