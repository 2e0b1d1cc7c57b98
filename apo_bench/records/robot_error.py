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
"""

import math
from typing import NamedTuple

from apo_bench.errors import InputError, require, require_text, unknown

NO_ROBOT_ERROR = "none"
DRAWN = "drawn"
_UNSTATED = "unstated"
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


def checked_stated_error(name: str) -> str:
    """A stated error as rows spell it.

    Raises:
        InputError: It is neither `drawn` nor `unstated`, nor what `robot_sigmas` takes.
    """
    require_text("stated error", name)
    if name in (DRAWN, _UNSTATED):
        return name
    if name != NO_ROBOT_ERROR and any(entry.partition(":")[0] not in _UNITS for entry in name.split("+")):
        raise InputError(unknown("stated error", name, (DRAWN, _UNSTATED, NO_ROBOT_ERROR, *_UNITS)))
    return _spelled_error(robot_sigmas(name, "stated error"))


def _spelled_error(sigmas: Sigmas) -> str:
    hand_eye, joints_deg, tool_mm, in_hand = sigmas
    sizes = {"hand_eye": hand_eye, "joints": (joints_deg,), "tool": (tool_mm,), "in_hand": in_hand}
    return "+".join(f"{kind}:{_spelled(size)}" for kind, size in sizes.items() if any(size)) or NO_ROBOT_ERROR


def told_error(stated_error: str, robot_error: str) -> str | None:
    """How wrong a robot is said to be, as in `robot_sigmas`; None if nobody says.

    Args:
        stated_error, robot_error: As in rows.
    """
    if stated_error == _UNSTATED:
        return None
    return robot_error if stated_error == DRAWN else stated_error


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
