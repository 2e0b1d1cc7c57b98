"""Suggest a base or a site at which an arm reaches a whole scenario."""

from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import replace
from itertools import product

import numpy as np

from apo_bench.errors import InputError
from apo_bench.simulation.arms.home import with_home
from apo_bench.simulation.arms.kinematics import Kinematics
from apo_bench.simulation.scene import Scene

_BASES_M = tuple(product((0.0, 0.1, 0.2), (-0.45, -0.4, -0.35, -0.3, -0.25, -0.2, -0.15, -0.1)))
"""Candidate bases: height and x, [m]; the middle of the table has x = 0."""
_NEARER_M = (0.04, 0.08, 0.12)
"""Candidate shifts of the site towards the arm."""
_NARROWER = 0.5
"""Factor on the spread of a shifted site."""


def place_in_reach(scene: Scene, reaches: Callable[[Scene], bool]) -> str:
    """The setting in the arm file or scenario file that brings everything into reach; empty if none was found.

    Args:
        reaches: Whether the arm of a scene reaches its scenario.
    """
    return next((text for text, nearer in _places(scene) if reaches(nearer)), "")


def _places(scene: Scene) -> Iterator[tuple[str, Scene]]:
    """Candidates with their setting in words: the arm at other bases, then the site nearer to the arm."""
    for z, x in _BASES_M if scene.arm.hand is not None else ():
        with suppress(InputError):
            arm = with_home(replace(scene.arm, base=(x, 0.0, z)), base_is_stated=True)
            home = ", ".join(f"{angle:.1f}" for angle in np.degrees(arm.home))
            text = f"base = {{ at_mm = [{1e3 * x:g}, 0, {1e3 * z:g}] }} and home_deg = [{home}]"
            moved = replace(scene, arm=arm, kinematics=Kinematics(arm))
            yield f"all is in reach with {text} in the file of the arm", moved
    site = scene.scenario.site
    for by in _NEARER_M:
        x, y = site.center_m
        spread = (_NARROWER * site.spread_m[0], _NARROWER * site.spread_m[1])
        nearer = replace(site, center_m=(x - by, y), spread_m=spread)
        numbers = ", ".join(f"{1e3 * v:g}" for v in nearer.center_m), ", ".join(f"{1e3 * v:g}" for v in spread)
        text = f"site: all is in reach with center_mm = [{numbers[0]}], spread_mm = [{numbers[1]}]"
        yield text, replace(scene, scenario=replace(scene.scenario, site=nearer))
