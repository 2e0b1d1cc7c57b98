"""Scenarios: read and check scenario files, and draw the layout of a trial."""

from apo_bench.scenario.attach_lines import list_nominal_operations
from apo_bench.scenario.human_error import NEGLIGIBLE_M, compute_human_error_covariance, spread_error
from apo_bench.scenario.layout import draw_layout, find_nominal_start, place_layout
from apo_bench.scenario.operation_order import find_floating_part
from apo_bench.scenario.play import check_clearance
from apo_bench.scenario.scenario import Grasp, HumanError, Scenario, Turn
from apo_bench.scenario.scenario_file import find_scenario_path, is_named, list_scenario_names, load_scenario

__all__ = (
    "NEGLIGIBLE_M",
    "Grasp",
    "HumanError",
    "Scenario",
    "Turn",
    "check_clearance",
    "compute_human_error_covariance",
    "draw_layout",
    "find_floating_part",
    "find_nominal_start",
    "find_scenario_path",
    "is_named",
    "list_nominal_operations",
    "list_scenario_names",
    "load_scenario",
    "place_layout",
    "spread_error",
)
