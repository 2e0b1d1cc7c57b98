"""The page of the command line, read from the program itself: every command with its arguments and options."""

from __future__ import annotations

import sys
from collections.abc import Iterator, Mapping
from typing import Any

import typer

from apo_bench.cli.app import app

HEAD = """# Command line

`apo-bench COMMAND --help` prints the same. Lengths are in mm, angles in degrees. The exit code is 0 where a result was
produced, also that of a replay that failed physically; 1 where none was produced; 2 where the request was wrong, with
one sentence on standard error; 128 and the number of the signal where a signal ended it.

`apo-bench --install-completion` lets bash, zsh and fish complete commands, options, and names of scenarios, methods,
noise models and arms when Tab is pressed.

In place of a name, `package.module:name` names your code. The module may be in the current folder; nothing else
there is imported. `python -m apo_bench` lets Python look for its modules in the current folder first; `apo-bench` and
`python -P -m apo_bench` do not.
"""


def page() -> str:
    """The page, as Markdown."""
    found = dict(commands(typer.main.get_command(app), "apo-bench"))
    listed = [f"- [`{name}`](#{name.replace(' ', '-')}): {first_sentence(each)}" for name, each in found.items()]
    return "\n".join([HEAD, *listed, *(line for name, each in found.items() for line in section(name, each))]) + "\n"


def commands(command: Any, name: str) -> Iterator[tuple[str, Any]]:
    """Every command that does something, with the words that call it."""
    inside: Mapping[str, Any] = getattr(command, "commands", {})
    if not inside:
        yield name, command
    for word, each in inside.items():
        yield from commands(each, f"{name} {word}")


def first_sentence(command: Any) -> str:
    return " ".join((command.help or "").split("\n\n")[0].split())


def section(name: str, command: Any) -> list[str]:
    """One command: what it does, and a table of what it takes."""
    words = [p.name.upper() if p.required else f"[{p.name.upper()}]" for p in command.params if not is_option(p)]
    paragraphs = [" ".join(part.split()) for part in (command.help or "").split("\n\n")]
    lines = ["", f"## {name} {{#{name.replace(' ', '-')}}}", "", f"`{' '.join([name, *words, '[OPTIONS]'])}`", ""]
    lines += ["\n\n".join(paragraphs), "", "| argument or option | meaning | default |", "|---|---|---|"]
    return lines + [row(p) for p in command.params if p.name != "help"]


def is_option(parameter: Any) -> bool:
    return bool(parameter.opts[0].startswith("-"))


def row(parameter: Any) -> str:
    shown = ", ".join(f"`{word}`" for word in parameter.opts) if is_option(parameter) else f"`{parameter.name.upper()}`"
    default = parameter.default
    stated = "" if default is None or isinstance(default, bool) or callable(default) else f"`{default}`"
    if parameter.required:
        stated = "required"
    meaning = " ".join((parameter.help or "").split()).replace("|", "\\|")
    return f"| {shown} | {meaning} | {stated} |"


if __name__ == "__main__":
    sys.stdout.write(page())
