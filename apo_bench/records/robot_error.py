"""What is wrong with the robot itself, by the names that rows use: kinds with their standard deviations.

`none`              nothing
`hand_eye:1/0.2`    where the camera believes the robot's base to be: mm per axis, degrees per axis
`joints:0.05`       the zero of every joint: degrees
`tool:0.5`          where the tip is on the hand: mm per axis
`in_hand:0.5/1`     how a part slips in the hand when it was taken: mm along the pads, degrees about their normal

Several are joined by `+`.
"""

import math
from typing import NamedTuple

from apo_bench.errors import InputError, unknown

NONE = "none"
LARGEST = 20.0
"""Standard deviation, [mm] or [deg]."""
_UNITS = {"hand_eye": ("mm", "degrees"), "joints": ("degrees",), "tool": ("mm",), "in_hand": ("mm", "degrees")}
"""Kind -> what its numbers are; the second one may be left out and is 0 then."""


class Sigmas(NamedTuple):
    """Standard deviations, [mm] and [deg]."""

    hand_eye: tuple[float, float] = (0.0, 0.0)
    joints_deg: float = 0.0
    tool_mm: float = 0.0
    in_hand: tuple[float, float] = (0.0, 0.0)


def robot_sigmas(given: str) -> Sigmas:
    """The standard deviations that a name stands for.

    Raises:
        InputError: An unknown kind, one that is there twice, or a number that is not allowed.
    """
    if given == NONE:
        return Sigmas()
    found: dict[str, tuple[float, ...]] = {}
    for one in given.split("+"):
        kind, _, sizes = one.partition(":")
        if kind not in _UNITS:
            raise InputError(unknown("kind of robot error", kind, (NONE, *_UNITS)))
        if kind in found:
            raise InputError(f"the robot error '{given}' was given, which has {kind} twice; say it once.")
        found[kind] = _numbers(given, kind, sizes)
    hand_eye, in_hand = (_pair(found.get(kind, ())) for kind in ("hand_eye", "in_hand"))
    return Sigmas(hand_eye, found.get("joints", (0.0,))[0], found.get("tool", (0.0,))[0], in_hand)


def checked_robot_error(given: str) -> str:
    """The robot's errors as rows spell them, `none` if all are zero.

    Raises:
        InputError: As in `robot_sigmas`.
    """
    hand_eye, joints_deg, tool_mm, in_hand = robot_sigmas(given)
    sizes = {"hand_eye": hand_eye, "joints": (joints_deg,), "tool": (tool_mm,), "in_hand": in_hand}
    said = [f"{kind}:{_spelled(size)}" for kind, size in sizes.items() if any(size)]
    return "+".join(said) or NONE


def _numbers(given: str, kind: str, sizes: str) -> tuple[float, ...]:
    units = _UNITS[kind]
    try:
        found = tuple(float(size) + 0.0 for size in sizes.split("/"))
    except ValueError:
        found = (math.nan,)
    if len(found) > len(units) or not all(0.0 <= size <= LARGEST for size in found):
        example = f"{kind}:{'/'.join(('0.5', '0.1')[: len(units)])}"
        raise InputError(
            f"the robot error '{given}' was given; standard deviations in {' and '.join(units)} from 0 to {LARGEST:g} "
            f"are allowed: {example}."
        )
    return found


def _pair(sizes: tuple[float, ...]) -> tuple[float, float]:
    mm, deg = (*sizes, 0.0, 0.0)[:2]
    return mm, deg


def _spelled(size: tuple[float, ...]) -> str:
    """`1`, or `1/0.2`: numbers that read back as they are."""
    shown = size[:1] if len(size) > 1 and not size[1] else size
    return "/".join(repr(x).removesuffix(".0") for x in shown)
