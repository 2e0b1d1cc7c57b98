"""A baseline: contacts, penetration and prior as penalties, minimised by gradient descent.

This is how refiners of object poses make an estimate physically plausible: PhysPose (arXiv 2503.23587) and VeREFINE
(arXiv 1909.05730) pull objects to their supports and out of each other, SporeAgent (arXiv 2201.00239) scores both. The
loss, in units of stated standard deviations, is

    sum (e / PENALTY_CONTACT_M)^2 + sum (depth / PENALTY_CONTACT_M)^2 + sum |z_k|^2

with e of every contact ever made, the depth of every two boxes (of no other pieces) of parts in contact, at the time
the contact was made, and z_k = L_k^-1 xi_k. Adam (Kingma and Ba, arXiv 1412.6980) takes `ADAM_STEPS` steps in z, whose
length falls from `LENGTH` to nothing along a quarter of a cosine. It ends there, at rest or not.
"""

from dataclasses import dataclass
from typing import final

import numpy as np

from apo_bench.assembly import Correction, Equations, Observation, build_contact_equations
from apo_bench.correction.baselines.intruding_boxes import Meeting, intruding, meeting
from apo_bench.correction.checks.as_given import run_method
from apo_bench.correction.solvers import WhitenedPoses
from apo_bench.correction.solvers.whitened import whitened
from apo_bench.geometry import Array

PENALTY_CONTACT_M = 1e-4
"""Gap or depth that costs as much as one standard deviation of noise, [m]; tuned on seeds that no table uses."""
ADAM_STEPS = 600
"""Number of steps of Adam."""
LENGTH = 0.2
"""Step size of Adam at the start, in standard deviations, tuned on the same seeds."""
_MEAN = 0.9
"""Decay rate of Adam's mean of the gradient, as its authors recommend."""
_SQUARE = 0.999
"""Decay rate of Adam's mean of the squared gradient, as its authors recommend."""
_TINY = 1e-8
"""Keeps Adam from dividing by 0."""


def penalty(observation: Observation, *, contact_m: float = PENALTY_CONTACT_M, length: float = LENGTH) -> Correction:
    """The poses at which the descent ends.

    Args:
        contact_m: Gap or depth that costs as much as one standard deviation of noise, [m].
        length: Step of Adam at the beginning, in standard deviations.

    Returns:
        `converged` with the gap that is left in the sentence, since it is meant to be executed as it is; or `not_seen`.

    Raises:
        InputError: A covariance is not positive definite.
    """
    return run_method(
        observation,
        lambda observation: _descend(observation, contact_m, length),
        f"the descent ended after {ADAM_STEPS} steps",
    )


@final
@dataclass(frozen=True, eq=False)
class Loss:
    """The loss that is minimised, as a function of z."""

    space: WhitenedPoses
    contacts: Equations
    meetings: Meeting
    contact_m: float

    def __call__(self, z: Array) -> tuple[float, Array]:
        """The loss and its gradient, (6 n,)."""
        poses = self.space.poses(z)
        value = float(z @ z)
        gradient = 2 * z
        for system in (self.contacts, intruding(self.meetings, poses)):
            e, J = system.linearise(poses)
            value += float(e @ e) / self.contact_m**2
            gradient = gradient + 2 * (e @ self.space.pull_back(z, J)) / self.contact_m**2
        return value, gradient


def loss(observation: Observation, contact_m: float = PENALTY_CONTACT_M) -> Loss:
    """The loss of an observation."""
    system = build_contact_equations(observation.assembly, observation.start, observation.poses)
    return Loss(whitened(observation), system, meeting(observation.assembly, system), contact_m)


def _descend(observation: Observation, contact_m: float, length: float) -> Array:
    """The poses, (n, 4, 4), after the last step of Adam."""
    down = loss(observation, contact_m)
    z = np.zeros(6 * len(observation.poses))
    m = np.zeros_like(z)
    v = np.zeros_like(z)
    for t in range(1, ADAM_STEPS + 1):
        _, g = down(z)
        m = _MEAN * m + (1 - _MEAN) * g
        v = _SQUARE * v + (1 - _SQUARE) * g**2
        step = length * np.cos(0.5 * np.pi * t / ADAM_STEPS)
        z = z - step * (m / (1 - _MEAN**t)) / (np.sqrt(v / (1 - _SQUARE**t)) + _TINY)
    return down.space.poses(z)
