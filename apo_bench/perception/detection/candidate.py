"""Candidates: pairs of faces whose gap and angle the noise can explain, so that they may touch."""

from math import sqrt
from typing import NamedTuple

import numpy as np

from apo_bench.assembly import Contact, FacingPair, Observation, PartFace
from apo_bench.geometry import Array
from apo_bench.perception.detection.thresholds import (
    PairThresholds,
    Rules,
    compute_contact_covariance,
    compute_contact_slack,
    compute_pair_thresholds,
)

_IMPLIED = 1.0
"""A candidate with a smaller `gain` is implied by the contacts already taken."""


class Candidate(NamedTuple):
    """A pair of faces that may touch, with the statistics of the decision."""

    contact: Contact
    pair: FacingPair
    """Measured gap and tilts at the current poses."""
    jacobian: Array
    """(r, 6 n): derivative of its residual by body twists of all poses; r is 3 for flat faces."""
    noise: Array
    """(r, r): covariance of the residual of a true contact, see `compute_contact_covariance`."""
    largest_distance: PairThresholds
    """Largest gap and angle that the noise explains."""
    distance: float
    """Squared Mahalanobis length of its residual."""
    gain: float
    """Twice the log-likelihood ratio of a closed pair to one anywhere in the range that the other contacts leave."""
    deviation_m: float
    """Standard deviation of its gap."""
    normal: Array
    """Normal of the environment face, (3,), world; zero for round faces."""

    @property
    def is_implied(self) -> bool:
        """True if the contacts taken before already make these faces touch, so there is nothing to decide."""
        return self.gain < _IMPLIED

    @property
    def parts(self) -> tuple[str, str]:
        """Names of the manipulated and of the environment part."""
        return self.contact.manipulated.part, self.contact.environment.part


def make_candidate(
    seen: Observation, rules: Rules, a: str, b: str, T_b: Array, pair: FacingPair, slope: Array, C: Array
) -> Candidate | None:
    """Make a candidate, with gain 0, of a pair of faces of parts a and b; None if it exceeds the thresholds.

    Args:
        T_b: (4, 4), pose of part b, world, [m].
        slope: (r, 6 n): derivative of the residual by body twists of all poses.
        C: (r, r): covariance of the residual, from the poses alone.
    """
    contact = Contact(PartFace(a, pair.a), PartFace(b, pair.b))
    play_m = seen.assembly.play(contact, seen.play_m)
    noise = compute_contact_covariance(pair, play_m)
    most = compute_pair_thresholds(rules, C, compute_contact_slack(pair, play_m), pair.lengths)
    if abs(pair.gap_m) > most.gap_m or pair.angle_rad > most.angle_rad:
        return None
    # Squared Mahalanobis length: C comes from the poses, noise from the play and softness of a true contact.
    distance = float(pair.residual @ np.linalg.solve(C + noise, pair.residual))
    is_flat = not seen.assembly.is_round(contact)
    normal = T_b[:3, :3] @ seen.assembly.face(contact.environment).normal if is_flat else np.zeros(3)
    return Candidate(contact, pair, slope, noise, most, distance, 0.0, sqrt(C[0, 0] + noise[0, 0]), normal)
