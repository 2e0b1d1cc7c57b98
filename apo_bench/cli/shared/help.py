"""Lay out help pages: groups of commands and options, then examples."""

import signal
from collections.abc import Mapping
from inspect import cleandoc
from types import MappingProxyType
from typing import Any

import typer
from typer.core import TyperCommand, TyperGroup

from apo_bench.records import NOISE_LEVEL, SETTINGS

GROUPS: Mapping[str, tuple[str, ...]] = MappingProxyType(
    {
        "One trial": ("run", "view", "inspect"),
        "Your own poses and cameras": ("correct", "detect-contacts", "recording", "noise"),
        "Your own tasks and robots": ("scenario", "assembly", "part", "arm"),
        "Many trials": ("sweep", "report", "compare", "score", "leaderboard", "method", "track", "dataset"),
        "Installation": ("doctor",),
    }
)
"""Heading -> commands of `apo-bench`, in this order."""
_OTHER_OPTIONS: Mapping[str, tuple[str, ...]] = MappingProxyType(
    {
        "Task and robot": (),
        "Robot that probes": (),
        "Observation": ("--observation",),
        "Correction": (),
        "Trials": ("--trials", "--independent-seeds"),
        "Simulation": ("--trial-limit",),
        "Processes": ("--workers", "--backend", "--address"),
        "Files": ("--out", "--save-observation", "--video"),
        "Display": ("--verbose", "--view", "--port", "--json"),
    }
)
"""Heading -> options that are no settings, in this order below those of the settings with this heading."""
OPTIONS: Mapping[str, tuple[str, ...]] = {
    heading: (*(f"--{info.option}" for info in (NOISE_LEVEL, *SETTINGS.values()) if info.heading == heading), *names)
    for heading, names in _OTHER_OPTIONS.items()
}
"""Heading -> options of `apo-bench run` and `sweep`, in this order."""
OTHERS = "Other options"
"""Heading of the options without a heading of their own."""
_RESUMED = ("sweep", "score")  # commands that continue after an interruption
_WHOLE = 10_000  # letters of a sentence that are shown: all of them
_KILLED = 128  # a process ended by a signal has this exit code plus the number of the signal


class Interruption(Exception):
    """A signal ended a command.

    Attributes:
        code: Exit code, 128 and the number of the signal.
    """

    def __init__(self, error: KeyboardInterrupt, more: str) -> None:
        number = int(getattr(error, "number", signal.SIGINT))
        how = "interrupted" if number == signal.SIGINT else f"ended by {signal.Signals(number).name}"
        super().__init__(f"{how}{more}.")
        self.code = _KILLED + number


class _WithExamples:
    """Prints the lines below `Examples:` of a help text at the end of the page."""

    help: str | None

    def __init__(self, *args: Any, **more: Any) -> None:
        super().__init__(*args, **more)
        self.help, _, self.examples = cleandoc(more["help"] or "").partition("\n\nExamples:\n")

    def format_epilog(self, ctx: Any, formatter: Any) -> None:
        """Write the examples."""
        with formatter.section("Examples"):
            formatter.write("".join(f"{line}\n" for line in self.examples.splitlines()))


class Command(_WithExamples, TyperCommand):
    """A command; those with many options list them under the headings of `OPTIONS`."""

    def invoke(self, ctx: Any) -> Any:
        """Run the command; a signal raises `Interruption`."""
        try:
            return super().invoke(ctx)
        except KeyboardInterrupt as error:
            kept = "; the trials that ended are kept, and the same command continues"
            raise Interruption(error, kept * (self.name in _RESUMED)) from error

    def format_options(self, ctx: Any, formatter: Any) -> None:
        """Write a list of options for each heading that has any."""
        if self.name not in ("run", "sweep"):
            return super().format_options(ctx, formatter)
        records = {p.opts[0]: record for p in self.get_params(ctx) if (record := p.get_help_record(ctx)) is not None}
        lists = {
            heading: [records.pop(name) for name in names if name in records] for heading, names in OPTIONS.items()
        }
        arguments = [records.pop(name) for name in list(records) if not name.startswith("-")]
        # left over: options without a heading
        for heading, listed in ({"Arguments": arguments} | lists | {OTHERS: list(records.values())}).items():
            if listed:
                with formatter.section(heading):
                    formatter.write_dl(listed)
        return None


class Group(_WithExamples, TyperGroup):
    """A group of commands; those of `apo-bench` itself are listed under the headings of `GROUPS`."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Show the help page if no command is named."""
        return super().parse_args(ctx, args or ["--help"])

    def format_commands(self, ctx: Any, formatter: Any) -> None:
        """Write a list of commands for each heading."""
        sentences = {name: command.get_short_help_str(_WHOLE) for name, command in self.commands.items()}
        widest = max(map(len, sentences))
        groups = GROUPS if ctx.parent is None else {"Commands": tuple(sentences)}
        for heading, names in groups.items():
            with formatter.section(heading):
                formatter.write_dl([(f"{name:{widest}}", sentences[name]) for name in names])


def make_group(name: str, description: str) -> typer.Typer:
    """Return a group of commands below one name."""
    return typer.Typer(name=name, cls=Group, rich_markup_mode=None, help=description)
