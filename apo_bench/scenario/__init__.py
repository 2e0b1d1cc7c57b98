"""Scenarios: files, checks and layouts."""

from apo_bench.scenario.attach_lines import nominal_operations
from apo_bench.scenario.file import is_named, load_scenario, scenario_names, scenario_path
from apo_bench.scenario.human_error import NOTHING_M, human_error_covariance, spread_error
from apo_bench.scenario.layout import draw_layout, layout_at, nominal_start
from apo_bench.scenario.order import in_the_air
from apo_bench.scenario.play import check_clearance
from apo_bench.scenario.scenario import Grasp, HumanError, Scenario, Turn

__all__ = (
    "NOTHING_M",
    "Grasp",
    "HumanError",
    "Scenario",
    "Turn",
    "check_clearance",
    "draw_layout",
    "human_error_covariance",
    "in_the_air",
    "is_named",
    "layout_at",
    "load_scenario",
    "nominal_operations",
    "nominal_start",
    "scenario_names",
    "scenario_path",
    "spread_error",
)
