"""How `--help` lists commands: in groups, each with its whole first sentence."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

from typer.core import TyperGroup

GROUPS: Mapping[str, tuple[str, ...]] = MappingProxyType(
    {
        "Start": ("scenarios", "replay", "view", "show"),
        "One plan, looked into": ("graph", "explain", "plan", "scene"),
        "Your own poses and cameras": ("correct", "recognise", "recording", "eye", "noise"),
        "Your own tasks and arms": ("scenario", "part", "arm"),
        "Many trials": ("sweep", "report", "compare", "power"),
    }
)
"""Heading -> commands of `apo-bench`, in this order."""
_WHOLE = 10_000
"""Letters of a sentence that are shown: all."""


class Grouped(TyperGroup):
    """The commands of `apo-bench` under the headings of `GROUPS`; those of `apo-bench noise` etc. in one."""

    def format_commands(self, ctx: Any, formatter: Any) -> None:
        """Write a list for each heading that has a command here."""
        sentences = {name: one.get_short_help_str(_WHOLE) for name, one in self.commands.items()}
        widest = max(map(len, sentences), default=0)
        groups = GROUPS if ctx.parent is None else {"Commands": tuple(sentences)}
        for heading, names in groups.items():
            with formatter.section(heading):
                formatter.write_dl([(f"{name:{widest}}", sentences[name]) for name in names])
