"""Whether parts start on something: what starts in the air falls before anybody takes it."""

import numpy as np

from apo_bench.assembly import Assembly, Poses
from apo_bench.geometry import TOUCH_M, drop_depths
from apo_bench.geometry.drop import drop

AIR_M = 1e-4
"""Lower above what is below it, a part settles within the first steps and is where it was said to be."""


def in_the_air(assembly: Assembly, start: Poses, most_m: float = AIR_M) -> tuple[str, str] | None:
    """The first movable part that starts more than so much above what is below it, and where it is, in words."""
    for part in assembly.solids:
        if part not in assembly.fixed and not _supported(assembly, start, part, most_m):
            return part, _height(assembly, start, part)
    return None


def _supported(assembly: Assembly, start: Poses, part: str, most_m: float) -> bool:
    solid = assembly.solids[part]
    T = start[part]
    way = np.array([most_m])
    return any(
        drop_depths(solid, T, way, other, start[name])[0] > TOUCH_M
        for name, other in assembly.solids.items()
        if name != part
    )


def _height(assembly: Assembly, start: Poses, part: str) -> str:
    falls = {
        name: drop(assembly.solids[part], start[part], other, start[name])
        for name, other in assembly.solids.items()
        if name != part
    }
    below = min(falls, key=lambda name: falls[name])
    if np.isinf(falls[below]):
        return f"'{part}' starts in the air, with nothing below it"
    return f"'{part}' starts in the air, {round(1e3 * falls[below], 2):g} mm above '{below}'"
