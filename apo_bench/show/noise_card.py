"""The card of a noise model: formula, frame, parameters, and a histogram of what it really does, in text or drawn with
the Gaussian that its observations state."""

import inspect
from collections.abc import Mapping
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from apo_bench.assembly import Demonstration, placements
from apo_bench.geometry import Array, pose
from apo_bench.io import default_looks, save_figure
from apo_bench.names import resolve
from apo_bench.observation.looking import observe
from apo_bench.observation.models import Camera, Facts
from apo_bench.observation.noise import FAILURES, NOISES, Level, make_noise
from apo_bench.observation.noise_file import noise_path, presets, read_noise
from apo_bench.scenario.file import load_scenario

SCENARIO = "stick_in_tower"
_DRAWS = 1000
"""Observations of that scenario, three operations each, behind a histogram."""
_PANELS = (("across the ray", "mm"), ("along the ray", "mm"), ("tilt", "deg"), ("about the ray", "deg"))
_BINS = 17
_WIDTH = 14
"""Bins of a histogram in text, the outermost with all that is beyond, and the length of its longest bar."""
_SIZE_INCH = (9.0, 2.3)
_DRAWN_BINS = 49
_REACH = 6.0
"""Half width of a drawn panel in stated standard deviations; what is beyond is counted in the outermost bins."""
_COLOR = "#4477aa"


class Drawn(NamedTuple):
    """Errors that a model made."""

    errors: Array
    """(m, 4), in the frame of the default camera's ray: across and along in mm, tilt and about the ray in degrees."""
    stated: Array
    """(4,), root mean square of the standard deviations that the observations stated, in the same units."""
    missed: float
    """Share of operations that were not seen."""


def listed_models() -> Mapping[str, str]:
    """Name -> what it is, of every model that has a name."""
    return {name: facts(name).title for name in NOISES} | {
        name: f"measured: {read_noise(path)[0].source.split(':')[0]}" for name, path in presets().items()
    }


def facts(model: Any) -> Facts:
    """What a model says of itself; of one that says nothing, its docstring."""
    model = _model(model)
    title = (inspect.getdoc(model) or "A noise model that says nothing of itself.").split("\n\n")[0]
    own = getattr(model, "FACTS", None)
    return own if isinstance(own, Facts) else Facts(" ".join(title.split()), (), "", (), "")


def _model(model: Any) -> Any:
    """What a name stands for: a class, or an object that no level changes, but what is measured at level 1."""
    known = isinstance(model, str) and (noise_path(model) is not None or model.partition(":")[0] in FAILURES)
    return make_noise(model, Level(1.0, 1.0)) if known else resolve(model, NOISES, "noise model")


def draw_errors(model: Any, level: Level, draws: int = _DRAWS) -> Drawn:
    """Errors of many observations of the nominal example 5.1; operations that were not seen have none."""
    noise = make_noise(model, level)
    demonstration = nominal_demonstration()
    camera = Camera()
    rng = np.random.default_rng(0)
    errors = []
    variances = []
    for _ in range(draws):
        observation = observe(demonstration, noise, rng)
        # error xi of T Exp(xi), turned from the part's own frame into that of the ray: R_ray^T R_part, for both halves
        Q = np.kron(np.eye(2), np.swapaxes(camera.frames(observation.goals), 1, 2) @ observation.goals[:, :3, :3])
        xi = (Q @ pose.log(pose.inverse(demonstration.goals) @ observation.goals)[..., None])[..., 0]
        errors.append(xi[observation.seen])
        covariance = Q @ observation.covariance @ np.swapaxes(Q, 1, 2)
        variances.append(np.diagonal(covariance, axis1=1, axis2=2)[observation.seen])
    # x is across the ray and z along it; rx tilts it and rz turns about it
    scale = np.array([1e3, 1e3, np.degrees(1.0), np.degrees(1.0)])
    four = np.concatenate(errors)[:, [0, 2, 3, 5]] * scale
    stated = np.concatenate(variances)[:, [0, 2, 3, 5]]
    return Drawn(
        four,
        np.sqrt(stated.sum(axis=0) / max(1, len(stated))) * scale,
        1.0 - len(four) / (draws * len(demonstration.goals)),
    )


def nominal_demonstration() -> Demonstration:
    """What a careful human shows: the nominal goals of example 5.1, in the middle of where they may stand."""
    scenario = load_scenario(SCENARIO)
    goals = pose.at(np.append(scenario.site.center_m, 0.0)) @ scenario.goals
    final = placements(scenario.assembly, scenario.start, goals)[-1]
    return Demonstration(scenario.assembly, scenario.start, goals, final, np.zeros((len(goals), 6, 6)))


def noise_card(model: Any, level: Level, drawn: Drawn | None = None) -> str:
    """The card of a model in Markdown, with a histogram in text of `drawn` (none: of what `draw_errors` draws)."""
    drawn = drawn or draw_errors(model, level)
    if not len(drawn.errors):
        return f"{model_description(model)}\nNothing was seen: every operation of {SCENARIO} was missed.\n"
    bars = "\n".join(f"    {line}".rstrip() for line in _histogram(drawn))
    return f"{model_description(model)}\n{drawn_sentence(model, drawn, level)}:\n\n{bars}\n"


def model_description(model: Any, heading: int = 1) -> str:
    """What a model says of itself, without a histogram."""
    about = facts(model)
    name = model if isinstance(model, str) else getattr(model, "__name__", type(model).__name__)
    lines = (
        *[f"Frame: {about.frame}."] * bool(about.frame),
        *(f"Parameter {parameter}." for parameter in about.parameters),
        *[f"States: {about.states}."] * bool(about.states),
        *(f"{note}." for note in about.notes),
    )
    parts = (
        f"{'#' * heading} {name}: {about.title}",
        "\n".join(f"    {line}" for line in about.formula),
        "\n".join(f"- {line}" for line in lines),
    )
    return "\n\n".join(filter(None, parts)) + "\n"


def drawn_sentence(model: Any, drawn: Drawn, level: Level) -> str:
    """One sentence on what was drawn, without its full stop."""
    if facts(model).measured:
        apart = f" in mm and {level.deg:g} times in deg" if level.deg != level.mm else ""
        where = "as measured" if level == (1.0, 1.0) else f"{level.mm:g} times{apart} what was measured"
    elif isinstance(_model(model), type):
        where = f"at {level.mm:g} mm and {level.deg:g} deg"
    else:
        where = "at every level alike"
    missed = f"; {100 * drawn.missed:.1f} % were not seen" if drawn.missed else ""
    n = f"{len(drawn.errors)} operations of {SCENARIO}"
    return f"Errors {where}, {n}{missed}"


@default_looks()
def draw_histogram(drawn: Drawn, path: Path) -> None:
    """Write the four panels as PNG: error across and along the ray, tilt, turn about the ray; densities are log."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=_SIZE_INCH, layout="constrained")
    axes = figure.subplots(1, len(_PANELS))
    for i, (axis, (name, unit)) in enumerate(zip(axes, _PANELS, strict=True)):
        _panel(axis, drawn.errors[:, i], float(drawn.stated[i]))
        axis.set_xlabel(f"{name} [{unit}]", fontsize=9)
    axes[0].set_ylabel("density", fontsize=9)
    save_figure(figure, path, dpi=90)


def _histogram(drawn: Drawn) -> list[str]:
    """Bars over bins of half a stated standard deviation, and below them the deviations found and stated."""
    # in stated deviations; bins of half of one about 0, the outermost open
    unit = drawn.errors / np.where(drawn.stated > 0.0, drawn.stated, 1.0)
    edges = 0.5 * (np.arange(_BINS - 1) - (_BINS - 2) / 2)
    counts = np.array([np.bincount(np.digitize(column, edges), minlength=_BINS) for column in unit.T])
    longest = max(1, int(counts.max()))
    middles = (f"{(a + b) / 2:.1f}" for a, b in pairwise(edges))
    bins = (f"< {edges[0]:.2f}", *middles, f"> {edges[-1]:.2f}")
    bars = [["#" * int(np.ceil(_WIDTH * count / longest)) for count in row] for row in counts.T]
    found, stated = (
        [f"{value:.3g} {unit}" for value, (_, unit) in zip(values, _PANELS, strict=True)]
        for values in (np.sqrt(np.mean(drawn.errors**2, axis=0)), drawn.stated)
    )
    table = [
        ("stated", [name for name, _ in _PANELS]),
        *zip(bins, bars, strict=True),
        ("deviation", found),
        ("stated", stated),
    ]
    return [head.rjust(12) + "".join(f"  {cell:{_WIDTH}}" for cell in cells) for head, cells in table]


def _panel(axis: Any, errors: Array, stated: float) -> None:
    sigma = stated or 1.0
    edges = np.linspace(-_REACH * sigma, _REACH * sigma, _DRAWN_BINS + 1)
    axis.hist(np.clip(errors, edges[0], edges[-1]), edges, density=True, color=_COLOR, alpha=0.75)
    x = np.linspace(edges[0], edges[-1], 241)
    axis.plot(x, np.exp(-0.5 * (x / sigma) ** 2) / (sigma * np.sqrt(2.0 * np.pi)), color="black", linewidth=1.0)
    axis.set(yscale="log", ylim=(1e-4 / sigma, 1.5 / sigma))
    axis.tick_params(labelsize=8)
    axis.spines[["top", "right"]].set_visible(False)
