"""Nominal goals put to where things were seen; best of all they fit in the baseline `by-heart`.

`by-heart` reads the nominal goals of the scenario, which no corrector may, and no contact. Whatever the relative
goals of a layout are, it builds the same assembly.
"""

import numpy as np
from scipy.optimize import least_squares

from apo_bench.assembly import Observation
from apo_bench.geometry import Array, pose


def goals_by_heart(nominal: Array, observation: Observation) -> Array:
    """The nominal goals where x, y and yaw fit best what was seen.

    Least squares over all operations that were seen, each twist weighted with its stated covariance S = L L^t:
    min sum |L^-1 log((A N_k)^-1 G_k)|^2 over A = (x, y, yaw), with N_k nominal and G_k seen.

    Args:
        nominal: (n, 4, 4), frame of the assembly, [m].
        observation: At least one operation was seen.

    Returns:
        (n, 4, 4), world frame.
    """
    seen = np.flatnonzero(observation.seen)
    # whitened by L^-1, where S = L L^t, a twist counts in standard deviations
    factors = [np.linalg.inv(np.linalg.cholesky(observation.covariance[k])) for k in seen]

    def residuals(place: Array) -> Array:
        T = _planar(place)
        twists = [pose.log(pose.inverse(T @ nominal[k]) @ observation.goals[k]) for k in seen]
        return np.concatenate([L @ twist for L, twist in zip(factors, twists, strict=True)])

    start = _rough(nominal[seen], observation.goals[seen])
    return np.asarray(_planar(least_squares(residuals, start, x_scale=[0.01, 0.01, 0.1]).x) @ nominal)


def nominal_where_seen(nominal: Array, observation: Observation) -> Array:
    """The nominal goals (n, 4, 4) shifted and turned on the table to where the first operation was seen."""
    k = int(np.argmax(observation.seen))
    # of the whole motion from nominal to seen only the yaw and the shift on the table are taken
    T = observation.goals[k] @ pose.inverse(nominal[k])
    flat = pose.at((0.0, 0.0, 0.0), (0.0, 0.0, float(np.degrees(np.arctan2(T[1, 0], T[0, 0])))))
    flat[:2, 3] = (observation.goals[k] - flat @ nominal[k])[:2, 3]
    return np.asarray(flat @ nominal)


def _rough(nominal: Array, goals: Array) -> Array:
    """(x, y, yaw): the mean turn of the parts, then the mean of what is left."""
    # the mean yaw maximises the sum of tr(Rz(yaw)^t R_k) over the turns R_k from nominal to seen
    turns = goals[:, :3, :3] @ np.swapaxes(nominal[:, :3, :3], 1, 2)
    sine = (turns[:, 1, 0] - turns[:, 0, 1]).sum()
    cosine = (turns[:, 0, 0] + turns[:, 1, 1]).sum()
    yaw = float(np.arctan2(sine, cosine))
    T = _planar(np.array([0.0, 0.0, yaw]))
    return np.append((goals[:, :2, 3] - (T @ nominal)[:, :2, 3]).mean(axis=0), yaw)


def _planar(place: Array) -> Array:
    """(x, y, yaw) as (4, 4)."""
    x, y, yaw = place
    return pose.at((x, y, 0.0), (0.0, 0.0, float(np.degrees(yaw))))
