"""Words beside a picture: a title above it, below it what is done, and how it ended."""

import textwrap
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from apo_bench.io.figures import load_matplotlib

_Picture = NDArray[np.uint8]
ABOVE_PX = 32
BELOW_PX = 56
_EDGE_PX = 10
_LINE_PX = 22
_TEXT_PX = 15
_LETTERS = 86
"""In a line of the usual width; what is longer goes on in the next."""
_PAPER = (250, 250, 248)
_INK = (30, 30, 32)
_FAINT = (110, 110, 115)
_COLORS = {True: (20, 120, 50), False: (180, 30, 25), None: _INK}


class Caption(NamedTuple):
    """What is written around one picture."""

    title: str
    pace: str
    """How fast it is shown: `real time`, `x 2`."""
    lines: tuple[str, ...]
    """Two below the picture at most."""
    force: str
    """Written at the right of the first of them."""
    good: bool | None = None
    """Colours the lines: a success, a failure, or neither."""


def ending_lines(sentence: str) -> tuple[str, ...]:
    """A sentence in two lines at most."""
    return tuple(textwrap.wrap(sentence, _LETTERS, max_lines=2, placeholder=" .."))


def shortened(words: str) -> str:
    """As many words as a line holds."""
    return textwrap.shorten(words, _LETTERS, placeholder=" ..")


def captioned(picture: _Picture, inset: _Picture, caption: Caption) -> _Picture:
    """A picture with a small one in its upper right corner, and words above and below."""
    height, width = picture.shape[:2]
    page = Image.new("RGB", (width, height + ABOVE_PX + BELOW_PX), _PAPER)
    page.paste(Image.fromarray(picture), (0, ABOVE_PX))
    framed = Image.new("RGB", (inset.shape[1] + 2, inset.shape[0] + 2), _INK)
    framed.paste(Image.fromarray(inset), (1, 1))
    page.paste(framed, (width - framed.width, ABOVE_PX))
    draw = ImageDraw.Draw(page)
    _write(draw, width, ABOVE_PX / 2, caption.title, caption.pace, _INK)
    for i, line in enumerate(caption.lines):
        color = _COLORS[caption.good] if i == 0 or caption.good is not None else _FAINT
        at = height + ABOVE_PX + BELOW_PX / 2 + _LINE_PX * (i - (len(caption.lines) - 1) / 2)
        _write(draw, width, at, line, "" if i else caption.force, color)
    return np.asarray(page)


def _write(draw: Any, width: int, at: float, left: str, right: str, color: tuple[int, int, int]) -> None:
    draw.text((_EDGE_PX, at), left, fill=color, font=_font(), anchor="lm")
    draw.text((width - _EDGE_PX, at), right, fill=color, font=_font(), anchor="rm")


@cache
def _font() -> Any:
    """The letters that come with matplotlib."""
    fonts = Path(load_matplotlib().get_data_path()) / "fonts" / "ttf"
    return ImageFont.truetype(str(fonts / "DejaVuSans.ttf"), _TEXT_PX)
