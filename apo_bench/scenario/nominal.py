"""The operations of a scenario at its nominal goals, in macros."""

from functools import lru_cache

from apo_bench.assembly.goals import Poses
from apo_bench.geometry import pose
from apo_bench.insertion.operations import OperationMacros, understand
from apo_bench.scenario.scenario import Scenario


@lru_cache(maxsize=32)
def nominal_operations(scenario: Scenario) -> tuple[OperationMacros, ...]:
    """The operations of a scenario at its nominal goals."""
    lines = [attach.stated for attach in scenario.attach]
    return understand(scenario.assembly, nominal_start(scenario), scenario.goals, lines)


def nominal_start(scenario: Scenario) -> Poses:
    """Where every part starts, in the frame of the assembly, for the site in the middle of where it may be."""
    x, y = scenario.site.center_m
    low, high = scenario.site.yaw_rad
    site = pose.at((x, y, 0.0)) @ pose.exp([0.0, 0.0, 0.0, 0.0, 0.0, (low + high) / 2])
    back = pose.inverse(site)
    return {part: T if part in scenario.follows_site else back @ T for part, T in scenario.start.items()}
