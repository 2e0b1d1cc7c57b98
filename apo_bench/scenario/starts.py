"""Whether parts start on something: what starts in the air falls before anybody takes it."""

import numpy as np

from apo_bench.assembly import Assembly, Poses
from apo_bench.geometry import TOUCH_M, drop, drop_depths

AIR_M = 1e-4
"""Lower above what is below it, a part settles within the first steps and is where it was said to be."""


def in_the_air(assembly: Assembly, start: Poses, most_m: float = AIR_M) -> tuple[str, str] | None:
    """The first movable part that starts more than so much above what is below it, and where it is, in words."""
    for part, solid in assembly.solids.items():
        others = {name: other for name, other in assembly.solids.items() if name != part}
        way = np.array([most_m])
        deep = (drop_depths(solid, start[part], way, other, start[name])[0] for name, other in others.items())
        if part not in assembly.fixed and not any(depth > TOUCH_M for depth in deep):
            falls = {name: drop(solid, start[part], other, start[name]) for name, other in others.items()}
            below = min(falls, key=lambda name: falls[name])
            height = f"{round(1e3 * falls[below], 2):g} mm above '{below}'"
            return part, f"'{part}' starts in the air, {'with nothing below it' if np.isinf(falls[below]) else height}"
    return None
