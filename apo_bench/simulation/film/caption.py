"""Add title, captions and an inset to one picture of a film."""

from functools import cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

Picture = NDArray[np.uint8]
ABOVE_PX = 32  # height of the title
BELOW_PX = 56  # height of the captions
_EDGE_PX = 10  # margin at left and right
_LINE_PX = 22  # distance of lines
_TEXT_PX = 15  # size of the font
_PAPER = (250, 250, 248)
_INK = (30, 30, 32)
_FAINT = (110, 110, 115)
_COLORS = {True: (20, 120, 50), False: (180, 30, 25), None: _INK}  # by `Caption.good`


class Caption(NamedTuple):
    """The text around one picture."""

    title: str
    pace: str
    """Speed of the film, such as `real time`, `x 2`."""
    lines: tuple[str, ...]
    """At most two, below the picture."""
    force: str = ""
    """Text at the right of the first line."""
    good: bool | None = None
    """Colour of the lines: success, failure, or (None) neither."""


def add_caption(picture: Picture, inset: Picture, caption: Caption) -> Picture:
    """A picture with an inset in its upper right corner, and text above and below."""
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
    """Write one line with text at the left and at the right; `at` is the height of its middle in pixels."""
    draw.text((_EDGE_PX, at), left, fill=color, font=_font(), anchor="lm")
    draw.text((width - _EDGE_PX, at), right, fill=color, font=_font(), anchor="rm")


@cache
def _font() -> Any:
    return ImageFont.load_default(_TEXT_PX)
