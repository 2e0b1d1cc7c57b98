"""The sheet of a noise model: its stated facts, and a table of the errors that it draws."""

import inspect
from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

import numpy as np

from apo_bench.assembly import Demonstration, compute_placements
from apo_bench.geometry import Array, pose
from apo_bench.names import resolve
from apo_bench.perception.observation.models import Camera, Facts
from apo_bench.perception.observation.noise import FAILURES, NOISES, NoiseLevel, make_noise
from apo_bench.perception.observation.noise_file import list_noise_files, list_presets, read_noise
from apo_bench.perception.observation.observe import observe
from apo_bench.scenario.scenario_file import load_scenario

SCENARIO = "stick_in_tower"
_DRAWS = 1000
"""Number of simulated observations of `SCENARIO` in the table, three operations each."""
_ERRORS = ("across the ray [mm]", "along the ray [mm]", "tilt [deg]", "about the ray [deg]")
_PERCENTILES = (50, 90, 99)


class ErrorSample(NamedTuple):
    """Errors drawn from a noise model, and the standard deviations that the model states."""

    errors: Array
    """(m, 4), in the frame of the default camera's ray: across and along in mm, tilt and turn about it in degrees."""
    stated: Array
    """(4,), root mean square of the stated standard deviations, in the same units."""
    missed: float
    """Share of operations that were not observed."""


def list_models() -> Mapping[str, str]:
    """Return name -> title of every noise model that has a name."""
    measured = {name: f"measured: {read_noise(path)[0].source.split(':')[0]}" for name, path in list_presets().items()}
    return {name: find_facts(name).title for name in NOISES} | measured


def find_facts(model: Any) -> Facts:
    """Return the `FACTS` of a model; of a model without them, its docstring as the title."""
    model = _resolve_model(model)
    own = getattr(model, "FACTS", None)
    title = (inspect.getdoc(model) or "A noise model without a description.").split("\n\n")[0]
    return own if isinstance(own, Facts) else Facts(" ".join(title.split()), (), "", (), "")


def draw_errors(model: Any, noise_level: NoiseLevel) -> ErrorSample:
    """Draw errors in many observations of the nominal example 5.1, leaving out operations that were not observed.

    Args:
        model: Name or object of a noise model.
    """
    noise = make_noise(model, noise_level)
    demonstration = make_nominal_demonstration()
    camera = Camera()
    rng = np.random.default_rng(0)
    errors = []
    variances = []
    for _ in range(_DRAWS):
        observation = observe(demonstration, noise, rng)
        # rotate the error twist xi of T Exp(xi) from the part's frame to the ray's: the blocks of Q are R_ray^T R_part
        Q = np.kron(np.eye(2), np.swapaxes(camera.frames(observation.poses), 1, 2) @ observation.poses[:, :3, :3])
        xi = (Q @ pose.log(pose.inverse(demonstration.poses) @ observation.poses)[..., None])[..., 0]
        covariance = Q @ observation.covariance @ np.swapaxes(Q, 1, 2)
        errors.append(xi[observation.observed])
        variances.append(np.diagonal(covariance, axis1=1, axis2=2)[observation.observed])
    # columns of a twist in the ray's frame: x across the ray, z along it; rx tilts the part, rz turns it about the ray
    scale = np.array([1e3, 1e3, np.degrees(1.0), np.degrees(1.0)])
    four = np.concatenate(errors)[:, [0, 2, 3, 5]] * scale
    stated = np.concatenate(variances)[:, [0, 2, 3, 5]]
    missed = 1.0 - len(four) / (_DRAWS * len(demonstration.poses))
    return ErrorSample(four, np.sqrt(stated.sum(axis=0) / max(1, len(stated))) * scale, missed)


def make_nominal_demonstration() -> Demonstration:
    """Return the demonstration of an ideal human: the nominal poses of example 5.1 at the centre of their area."""
    scenario = load_scenario(SCENARIO)
    poses = pose.at(np.append(scenario.site.center_m, 0.0)) @ scenario.nominal_poses
    final = compute_placements(scenario.assembly, scenario.start, poses)[-1]
    return Demonstration(scenario.assembly, scenario.start, poses, final, np.zeros((len(poses), 6, 6)))


def write_noise_sheet(model: Any, noise_level: NoiseLevel, sample: ErrorSample) -> str:
    """Return the sheet of a model in Markdown, with a table of the drawn errors."""
    facts = describe_model(model)
    if not len(sample.errors):
        return f"{facts}\nNo operation of {SCENARIO} was observed.\n"
    missed = f"; {100 * sample.missed:.1f} % were not observed" if sample.missed else ""
    count = f"{len(sample.errors)} operations of {SCENARIO}{missed}"
    level = f"noise mm {noise_level.mm:g} and noise deg {noise_level.deg:g}"
    return "\n".join([facts, f"Errors at {level}, {count}:", "", *_tabulate(sample), ""])


def describe_model(model: Any, heading: int = 1) -> str:
    """Return the stated facts of a model in Markdown, under a heading of this level."""
    facts = find_facts(model)
    name = model if isinstance(model, str) else getattr(model, "__name__", type(model).__name__)
    lines = [f"Frame: {facts.frame}"] * bool(facts.frame)
    lines += [f"Parameter {parameter}" for parameter in facts.parameters]
    lines += [f"States: {facts.states}"] * bool(facts.states)
    lines += facts.notes
    formula = "\n".join(f"    {line}" for line in facts.formula)
    bullets = "\n".join(f"- {line}." for line in lines)
    return "\n\n".join(filter(None, (f"{'#' * heading} {name}: {facts.title}", formula, bullets))) + "\n"


def _tabulate(sample: ErrorSample) -> Iterator[str]:
    """Yield the lines of a Markdown table: of each error its deviation, the stated deviation, and percentiles."""
    found = np.sqrt(np.mean(sample.errors**2, axis=0))
    sizes = np.percentile(np.abs(sample.errors), _PERCENTILES, axis=0)
    yield f"| {'error':20} |" + "".join(f" {head:>9} |" for head in ("deviation", "stated", "p50", "p90", "p99"))
    yield "|---" * (len(_PERCENTILES) + 3) + "|"
    for name, *numbers in zip(_ERRORS, found, sample.stated, *sizes, strict=True):
        yield f"| {name:20} |" + "".join(f" {f'{number:.3g}':>9} |" for number in numbers)


def _resolve_model(model: Any) -> Any:
    """Return the class or object of a noise model's name.

    Measured models and camera failures are made at noise level 1; other models stay classes or objects.
    """
    known = isinstance(model, str) and (bool(list_noise_files(model)) or model.partition(":")[0] in FAILURES)
    return make_noise(model, NoiseLevel(1.0, 1.0)) if known else resolve(model, NOISES, "noise model")
