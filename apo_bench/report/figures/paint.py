"""Colours, markers and dashes: told apart without colour too, on a light and on a dark page."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import Any

from apo_bench.records.outcomes import STAGES
from apo_bench.report.figures.levels import CEILING, styles

DARKLY = {
    "#D55E00": "#FF9048",
    "#332288": "#A79BFF",
    "#0072B2": "#55B7F3",
    "#009E73": "#35CFA0",
    "#A6761D": "#D3A452",
    "#8C6BB1": "#BDA2DC",
    "#117733": "#57C47C",
    "#882255": "#E070A6",
    "#6B6B6B": "#ABABAB",
    "#000000": "#F2F2F2",
    CEILING: "#BBBBBB",
}
"""Colours that would drown on a dark page, and what stands for them there."""
STAGE_COLORS = {
    "observe": ("#999999", "#8A8A8A"),
    "correct": ("#AA4499", "#D27CC3"),
    "plan": ("#DDAA33", "#E6BC57"),
    "pick": ("#88CCEE", "#88CCEE"),
    "lift": ("#44AA99", "#5CC4B2"),
    "carry": ("#117733", "#4CAF70"),
    "attach": ("#D55E00", "#F0823A"),
    "release": ("#999933", "#B9B95A"),
    "depart": ("#882255", "#C65B92"),
    "judge": ("#0072B2", "#4BA3DB"),
    "worker": ("#222222", "#EEEEEE"),
}


def palette(methods: Sequence[str]) -> tuple[str, str]:
    """Custom properties for the light and for the dark page: `--m0` of the first method, `--stage-judge`, ..."""
    paints = [style.color for style in styles(methods).values()]
    light = [f"--m{i}:{color};" for i, color in enumerate(paints)]
    dark = [f"--m{i}:{DARKLY.get(color, color)};" for i, color in enumerate(paints)]
    for stage, (bright, dim) in STAGE_COLORS.items():
        light.append(f"--stage-{stage}:{bright};")
        dark.append(f"--stage-{stage}:{dim};")
    return "".join(light), "".join(dark)


def stage_paint(stage: str) -> str:
    """The colour of a stage as the style sheet knows it."""
    return f"var(--stage-{stage if stage in STAGE_COLORS else 'observe'})"


def stages_in_order(found: Iterable[str]) -> list[str]:
    """As a trial goes through them; any other at the end."""
    return sorted(set(found), key=lambda stage: (STAGES.index(stage) if stage in STAGES else len(STAGES), stage))


def dash(dashes: Any) -> str:
    """A dash pattern as SVG writes it; of a line without gaps nothing."""
    return "" if isinstance(dashes, str) else " ".join(f"{2 * length:g}" for length in dashes[1])


def marker(shape: str, x: float, y: float, size: float = 4.0) -> str:
    """The outline of a marker around a point, as the `d` of a path."""
    if shape in "PX+":
        return _cross(x, y, size, 0.0 if shape != "X" else math.pi / 4)
    corners = {"o": 20, "s": 4, "D": 4, "d": 4, "v": 3, "^": 3, "<": 3, ">": 3, "p": 5, "h": 6, "H": 6, "1": 3, "*": 10}
    turns = {"s": 45.0, "v": 180.0, "<": 270.0, ">": 90.0, "H": 30.0, "1": 180.0}
    n, turn = corners.get(shape, 20), math.radians(turns.get(shape, 0.0))
    points = []
    for k in range(n):
        a = turn + 2 * math.pi * k / n
        r = size * (0.45 if shape == "*" and k % 2 else 1.15)
        wide = 0.6 if shape == "d" else 1.0
        points.append(f"{x + wide * r * math.sin(a):.1f} {y - r * math.cos(a):.1f}")
    return f"M{'L'.join(points)}Z"


def _cross(x: float, y: float, size: float, turn: float) -> str:
    arm, half = 1.15 * size, 0.42 * size
    outline = [(-half, -arm), (half, -arm), (half, -half), (arm, -half), (arm, half), (half, half)]
    outline += [(-a, -b) for a, b in outline]
    c, s = math.cos(turn), math.sin(turn)
    return f"M{'L'.join(f'{x + c * a - s * b:.1f} {y + s * a + c * b:.1f}' for a, b in outline)}Z"
