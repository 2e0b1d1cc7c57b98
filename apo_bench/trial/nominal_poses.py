"""Place the nominal poses of a scenario on the table where an observation has them; no contact is used.

Any placement on the table builds the same assembly, since only relative poses matter.
"""

import numpy as np
from scipy.optimize import least_squares

from apo_bench.assembly import Observation
from apo_bench.geometry import Array, pose


def fit_nominal_poses(nominal: Array, observation: Observation) -> Array:
    """Move the nominal poses by the x, y and yaw that fit the observed poses best.

    Least squares over all observed operations, each twist weighted with its stated covariance S = L L^t:
    min sum |L^-1 log((A N_k)^-1 G_k)|^2 over A = (x, y, yaw), with N_k nominal and G_k observed.

    Args:
        nominal: (n, 4, 4), frame of the assembly, [m].
        observation: With at least one observed operation.

    Returns:
        (n, 4, 4), world frame, [m].
    """
    observed = np.flatnonzero(observation.observed)
    # whitened by L^-1, where S = L L^t, a twist counts in standard deviations
    factors = [np.linalg.inv(np.linalg.cholesky(observation.covariance[k])) for k in observed]

    def residuals(place: Array) -> Array:
        T = _make_planar_pose(place)
        twists = [pose.log(pose.inverse(T @ nominal[k]) @ observation.poses[k]) for k in observed]
        return np.concatenate([L @ twist for L, twist in zip(factors, twists, strict=True)])

    start = _guess_planar_pose(nominal[observed], observation.poses[observed])
    # scales of x, y [m] and yaw [rad]
    return np.asarray(_make_planar_pose(least_squares(residuals, start, x_scale=[0.01, 0.01, 0.1]).x) @ nominal)


def move_nominal_poses(nominal: Array, observation: Observation) -> Array:
    """Move the nominal poses, (n, 4, 4), [m], on the table to match the first observed operation in x, y and yaw."""
    k = int(np.argmax(observation.observed))  # the first observed operation
    # of the whole motion from nominal to observed only the yaw and the shift on the table are taken
    T = observation.poses[k] @ pose.inverse(nominal[k])
    flat = pose.at((0.0, 0.0, 0.0), (0.0, 0.0, float(np.degrees(np.arctan2(T[1, 0], T[0, 0])))))
    flat[:2, 3] = (observation.poses[k] - flat @ nominal[k])[:2, 3]  # shift in x and y
    return np.asarray(flat @ nominal)


def _guess_planar_pose(nominal: Array, observed: Array) -> Array:
    """(x, y, yaw): the mean turn of the parts, then the mean of the remaining shifts."""
    # the mean yaw maximises the sum of tr(Rz(yaw)^t R_k) over the turns R_k from nominal to observed
    turns = observed[:, :3, :3] @ np.swapaxes(nominal[:, :3, :3], 1, 2)
    sine = (turns[:, 1, 0] - turns[:, 0, 1]).sum()
    yaw = float(np.arctan2(sine, (turns[:, 0, 0] + turns[:, 1, 1]).sum()))
    T = _make_planar_pose(np.array([0.0, 0.0, yaw]))
    return np.append((observed[:, :2, 3] - (T @ nominal)[:, :2, 3]).mean(axis=0), yaw)


def _make_planar_pose(place: Array) -> Array:
    """The pose (4, 4) on the table of (x, y, yaw), [m, rad]."""
    x, y, yaw = place
    return pose.at((x, y, 0.0), (0.0, 0.0, float(np.degrees(yaw))))
