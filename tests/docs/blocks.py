"""Python blocks of a page: read, run in their order, and compared with the output that the page shows."""

from __future__ import annotations

import contextlib
import io
import math
import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

BLOCK = re.compile(
    r"^```python(?P<info>[^\n]*)\n(?P<code>.*?)^```$(?:\n+^```text\n(?P<output>.*?)^```$)?", re.MULTILINE | re.DOTALL
)
NUMBER = re.compile(r"[-+]?\d+(?:\.\d*)?(?:e[-+]?\d+)?")


@dataclass(frozen=True)
class Block:
    """One Python block of a page."""

    page: Path
    line: int
    """Of the page, counted from 1: the first line of the code."""
    info: str
    """What stands behind `python` in its first line, such as `title="mymodule.py"`."""
    code: str
    output: str | None
    """The `text` block that follows at once: what it prints; None if none does."""


def python_blocks(page: Path) -> list[Block]:
    """The Python blocks of a Markdown page, in their order."""
    text = page.read_text(encoding="utf-8")
    return [
        Block(page, text.count("\n", 0, m.start("code")) + 1, m["info"].strip(), m["code"], m["output"])
        for m in BLOCK.finditer(text)
    ]


def run_block(block: Block, names: dict[str, Any]) -> str:
    """Run a block among names that earlier blocks of the page made; what it prints.

    A traceback names the page and its line.
    """
    code = compile("\n" * (block.line - 1) + block.code, str(block.page), "exec")
    with contextlib.redirect_stdout(io.StringIO()) as printed:
        exec(code, names)
    return printed.getvalue()


def same_output(printed: str, shown: str, within: float = 0.02) -> bool:
    """Whether the words are the same, and the numbers to rounding; spaces do not count.

    Args:
        within: Relative and absolute; other processors may round the last digit otherwise.
    """
    words = ["".join(NUMBER.sub("0", text).split()) for text in (printed, shown)]
    if words[0] != words[1]:
        return False
    pairs = zip(NUMBER.findall(printed), NUMBER.findall(shown), strict=True)
    return all(math.isclose(float(a), float(b), rel_tol=within, abs_tol=within) for a, b in pairs)
