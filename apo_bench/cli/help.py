"""How `--help` lists commands and the options of long ones: in groups, each with its whole first sentence."""

from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Any

import typer
from typer.core import TyperCommand, TyperGroup

GROUPS: Mapping[str, tuple[str, ...]] = MappingProxyType(
    {
        "One trial": ("run", "view", "inspect"),
        "Your own poses and cameras": ("correct", "detect-contacts", "recording", "noise"),
        "Your own tasks and arms": ("scenario", "part", "arm"),
        "Many trials": ("sweep", "report", "compare", "score", "leaderboard", "dataset"),
    }
)
"""Heading -> commands of `apo-bench`, in this order."""
OPTIONS: Mapping[str, tuple[str, ...]] = MappingProxyType(
    {
        "Task and robot": ("--human-error-scale", "--clearance-mm", "--arm", "--grasp", "--robot-error"),
        "A robot that feels": ("--ft-sensor", "--assumed-robot-error"),
        "What is seen": (
            "--noise-level",
            "--noise-level",
            "--noise-mm",
            "--noise-deg",
            "--noise",
            "--pose-source",
            "--observation",
        ),
        "What a method makes of it": (
            *("--method", "--method", "--contact-source", "--max-reobservations", "--min-predicted-success"),
        ),
        "Which trials": ("--trials", "--seed", "--secret-seed-file"),
        "How they are simulated": ("--fidelity", "--timestep-ms", "--trial-limit"),
        "Where they run": ("--workers", "--backend", "--address"),
        "Files": ("--out", "--save-observation", "--video"),
        "What is shown": ("--view", "--port", "--json"),
    }
)
"""Heading -> options of `apo-bench run` and `sweep`, in this order."""
OTHERS = "Other options"
"""The heading of options that stand under none."""
_WHOLE = 10_000
"""Letters of a sentence that are shown: all."""


class Grouped(TyperGroup):
    """The commands of `apo-bench` under the headings of `GROUPS`; those of `apo-bench noise` etc. in one."""

    def format_commands(self, ctx: Any, formatter: Any) -> None:
        """Write a list for each heading that has a command here."""
        sentences = {name: command.get_short_help_str(_WHOLE) for name, command in self.commands.items()}
        widest = max(map(len, sentences), default=0)
        groups = GROUPS if ctx.parent is None else {"Commands": tuple(sentences)}
        for heading, names in groups.items():
            with formatter.section(heading):
                formatter.write_dl([(f"{name:{widest}}", sentences[name]) for name in names])


class GroupedOptions(TyperCommand):
    """A command with its options under the headings of `OPTIONS`; arguments come first, other options last."""

    def format_options(self, ctx: Any, formatter: Any) -> None:
        """Write a list for each heading that has an option here."""
        arguments = []
        options = {}
        for parameter in self.get_params(ctx):
            record = parameter.get_help_record(ctx)
            if record is not None and parameter.param_type_name == "argument":
                arguments.append(record)
            elif record is not None:
                options[parameter.opts[0]] = record
        lists = {
            heading: [options.pop(name) for name in names if name in options] for heading, names in OPTIONS.items()
        }
        for heading, listed in ({"Arguments": arguments} | lists | {OTHERS: list(options.values())}).items():
            if listed:
                with formatter.section(heading):
                    formatter.write_dl(listed)


def group(name: str, about: str, alone: Callable[[], None] | None = None) -> typer.Typer:
    """Commands below one name; `alone` is what the name does without any of them."""
    made = typer.Typer(name=name, cls=Grouped, rich_markup_mode=None, help=about)
    if alone is not None:

        @made.callback(invoke_without_command=True)
        def without_command(context: typer.Context) -> None:
            if context.invoked_subcommand is None:
                alone()

    return made
