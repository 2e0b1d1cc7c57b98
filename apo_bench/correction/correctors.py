"""Public entry point of corrections: call a corrector by name or as an object, and validate what it returns."""

from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from apo_bench.arguments import check_arguments
from apo_bench.assembly import Correction, Observation, Reobserver, ReobservingCorrector, project_observation
from apo_bench.correction.checks.as_given import gap_of, poses_as_given
from apo_bench.correction.checks.correction_checks import check_correction, check_observation, check_poses
from apo_bench.correction.checks.status import check_facing
from apo_bench.correction.contact.contact import ContactCorrector
from apo_bench.errors import RAISED, ArgumentError, InputError, failed, kind, require
from apo_bench.geometry import Array, copy_real
from apo_bench.names import resolve
from apo_bench.records import CORRECTOR, CORRECTORS

_STATUSES = ("converged", "not_seen", "inconsistent", "doubtful", "not_converged", "not_finite")
"""The statuses that a corrector may return."""


class CorrectorMisbehaved(InputError):
    """A corrector raised an error or returned an invalid result; the fault is the corrector's, not the request's."""


@check_arguments
def correct(observation: Observation, corrector: Any = CORRECTOR, reobserve: Reobserver | None = None) -> Correction:
    """Correct the poses of an observation.

    Args:
        observation: From `observe` or `read_observation`.
        corrector: A name (`apo-bench method list`), `"package.module:name"`, or a callable `Observation ->
            Correction`; it may return bare poses (n, 4, 4), world frame, [m], which are wrapped.
        reobserve: Observes operations again. A corrector with a method `correct_and_reobserve` (`ReobservingCorrector`)
            gets it, and that method is called in place of the corrector; any other gets nothing.

    Returns:
        Poses, status and test; check `ok` before you execute them. If a corrector returns numbers that are not finite,
        the status is `not_finite` and the poses are those observed.

    Raises:
        InputError: There is no such corrector, or the observation is inconsistent.
        CorrectorMisbehaved: The corrector raised an error, or returned something else or an impossible schedule.
    """
    check_observation(observation)
    chosen = resolve_corrector(corrector)
    name = _name_of(corrector, chosen)
    ours = _is_ours(chosen)
    # The equations contain planes only, so correctors of the package get round faces projected to planes. `contact`
    # projects the observations of direct callers too, and leaves projected ones unchanged.
    flat = project_observation(observation)
    given = flat if ours else observation
    try:
        reobserves = reobserve is not None and isinstance(chosen, ReobservingCorrector)
        returned = chosen.correct_and_reobserve(given, reobserve) if reobserves else chosen(given)
        correction = _admit(returned, flat, chosen, name)
    except InputError as error:
        if ours or isinstance(error, CorrectorMisbehaved):
            raise
        own = failed(f"the corrector '{name}'", error) if isinstance(error, ArgumentError) else error
        raise CorrectorMisbehaved(str(own)) from error
    except RAISED as error:
        raise CorrectorMisbehaved(str(failed(f"the corrector '{name}'", error))) from error
    if flat is observation or correction.assumed is None:
        return correction
    return replace(correction, assumed=replace(correction.assumed, assembly=observation.assembly))


def resolve_corrector(corrector: Any) -> Any:
    """The corrector with a name, or the given object itself.

    Raises:
        InputError: There is no such corrector, or it is no function.
    """
    chosen = resolve(corrector, CORRECTORS, "corrector")
    require(
        callable(chosen) and not isinstance(chosen, type),
        f"the corrector '{_name_of(corrector, chosen)}' is {kind(chosen)}; give a function that takes an Observation "
        "and returns a Correction, or an object with such a __call__.",
    )
    return chosen


def _name_of(corrector: Any, chosen: Any) -> str:
    """The name of a corrector in error messages."""
    return corrector if isinstance(corrector, str) else getattr(chosen, "__name__", type(chosen).__name__)


def _admit(returned: Any, observation: Observation, chosen: Any, name: str) -> Correction:
    """Convert what a corrector returned to a valid `Correction`.

    Results of correctors from outside the package are checked, and the gaps that they state are replaced by measured
    ones.

    Args:
        observation: The observation with round faces projected.
        chosen: The corrector.
        name: Its name in error messages.
    """
    if isinstance(returned, Correction) and _is_ours(chosen):
        # `ContactCorrector` has already checked which faces look the same way (`Solved.away`, `_in_doubt`).
        return returned if isinstance(chosen, ContactCorrector) else check_facing(observation, returned)
    if not isinstance(returned, Correction):
        poses = _checked_poses(returned, len(observation.poses), name)
        return poses_as_given(observation, poses, "the corrector returned poses and no status")
    require(
        returned.status in _STATUSES,
        f"the corrector '{name}' returned the status {returned.status!r}; return one of {', '.join(_STATUSES)}.",
    )
    poses = _checked_poses(returned.poses, len(observation.poses), name)
    check_correction(returned, observation.assembly, name)
    if not returned.ok:
        return returned
    before_m = gap_of(observation, observation.poses)
    return replace(returned, gap_before_m=before_m, gap_after_m=gap_of(observation, poses))


def _is_ours(corrector: Any) -> bool:
    """Whether a corrector is part of the package, so that its result is trusted.

    Programs and answer files, which `apo_bench.benchmark.scoring` wraps, are not.
    """
    while isinstance(corrector, partial):
        corrector = corrector.func
    return str(getattr(corrector, "__module__", "")).startswith(("apo_bench.correction.", "apo_bench.simulation."))


def _checked_poses(returned: Any, n: int, name: str) -> Array:
    """Convert what a corrector returned to rigid poses, (n, 4, 4); poses that are not finite are let through."""
    try:
        poses = copy_real(returned)
    except ArgumentError as error:
        raise InputError(f"the corrector '{name}' returned complex numbers as poses; return real ones.") from error
    except (TypeError, ValueError):
        poses = np.zeros(0)
    if poses.shape != (n, 4, 4):
        given = f"an array of shape {returned.shape}" if isinstance(returned, np.ndarray) else kind(returned)
        raise InputError(f"the corrector '{name}' returned {given}; return a Correction or poses of shape ({n}, 4, 4).")
    finite = np.flatnonzero(np.isfinite(poses).all(axis=(1, 2)))
    check_poses(poses[finite], [f"the pose of operation {k + 1} that the corrector '{name}' returned" for k in finite])
    return poses
