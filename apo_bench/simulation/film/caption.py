"""What is written around one picture of a film."""

from functools import cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

Picture = NDArray[np.uint8]
ABOVE_PX = 32
BELOW_PX = 56
_EDGE_PX = 10
_LINE_PX = 22
_TEXT_PX = 15
_PAPER = (250, 250, 248)
_INK = (30, 30, 32)
_FAINT = (110, 110, 115)
_COLORS = {True: (20, 120, 50), False: (180, 30, 25), None: _INK}


class Caption(NamedTuple):
    """The words around one picture."""

    title: str
    pace: str
    """How fast it is shown: `real time`, `x 2`."""
    lines: tuple[str, ...]
    """Two below the picture at most."""
    force: str = ""
    """Written at the right of the first of them."""
    good: bool | None = None
    """Colours the lines: a success, a failure, or neither."""


def add_caption(picture: Picture, inset: Picture, caption: Caption) -> Picture:
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
    return ImageFont.load_default(_TEXT_PX)
