"""What several commands share: options, help, checks of output files, printing."""

from apo_bench.cli.shared.arguments import (
    NO_RESULT,
    Address,
    AsJson,
    Backend,
    DeviationDeg,
    DeviationMm,
    MethodArgument,
    Port,
    ScenarioArgument,
    SecretSeedFile,
    Workers,
    path_argument,
    path_option,
)
from apo_bench.cli.shared.completion import completion
from apo_bench.cli.shared.cores import count_cores
from apo_bench.cli.shared.help import GROUPS, OPTIONS, Command, Group, Interrupted, group
from apo_bench.cli.shared.outputs import check_output, writing
from apo_bench.cli.shared.printing import console, print_columns, print_json, print_table, print_written, say
from apo_bench.cli.shared.setting_options import read_axis, shown_default, sweep_options, takes, trial_options
from apo_bench.cli.shared.values import parse_list, parse_path

__all__ = (
    "GROUPS",
    "NO_RESULT",
    "OPTIONS",
    "Address",
    "AsJson",
    "Backend",
    "Command",
    "DeviationDeg",
    "DeviationMm",
    "Group",
    "Interrupted",
    "MethodArgument",
    "Port",
    "ScenarioArgument",
    "SecretSeedFile",
    "Workers",
    "check_output",
    "completion",
    "console",
    "count_cores",
    "group",
    "parse_list",
    "parse_path",
    "path_argument",
    "path_option",
    "print_columns",
    "print_json",
    "print_table",
    "print_written",
    "read_axis",
    "say",
    "shown_default",
    "sweep_options",
    "takes",
    "trial_options",
    "writing",
)
