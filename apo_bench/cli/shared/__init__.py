"""Options, help pages, checks of output files and printing that several commands share."""

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
    make_path_argument,
    make_path_option,
)
from apo_bench.cli.shared.completion import complete_last_word
from apo_bench.cli.shared.cores import count_cores
from apo_bench.cli.shared.help import GROUPS, OPTIONS, Command, Group, Interruption, make_group
from apo_bench.cli.shared.outputs import check_output, name_write_errors
from apo_bench.cli.shared.printing import (
    print_columns,
    print_json,
    print_table,
    print_text,
    print_written,
)
from apo_bench.cli.shared.setting_options import (
    add_options,
    make_sweep_options,
    make_trial_options,
    read_axis,
)
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
    "Interruption",
    "MethodArgument",
    "Port",
    "ScenarioArgument",
    "SecretSeedFile",
    "Workers",
    "add_options",
    "check_output",
    "complete_last_word",
    "count_cores",
    "make_group",
    "make_path_argument",
    "make_path_option",
    "make_sweep_options",
    "make_trial_options",
    "name_write_errors",
    "parse_list",
    "parse_path",
    "print_columns",
    "print_json",
    "print_table",
    "print_text",
    "print_written",
    "read_axis",
)
