"""Candidates: pairs of faces that may touch, within the thresholds of the noise."""

from math import sqrt
from typing import NamedTuple

import numpy as np

from apo_bench.assembly import Contact, FacingPair, Observation, PartFace
from apo_bench.geometry import Array
from apo_bench.perception.detection.thresholds import PairThresholds, Rules, pair_thresholds, reality, slack

_IMPLIED = 1.0
"""A contact that gains less by closing, in twice the logarithm, closes anyway if those before do."""


class Candidate(NamedTuple):
    """A pair of faces that may touch."""

    contact: Contact
    pair: FacingPair
    slope: Array
    """(r, 6 n): derivative of its residual by body twists of all poses; r is 3 of flat faces."""
    noise: Array
    """(r, r): see `reality`."""
    most: PairThresholds
    distance: float
    """Squared Mahalanobis length of its residual."""
    gain: float
    """Twice the logarithm of how much likelier a closed pair is than one anywhere in the range that is left."""
    deviation_m: float
    """Of its gap."""
    normal: Array
    """Of the environment face, (3,), world; zero of round faces."""

    @property
    def implied(self) -> bool:
        """Whether it is no choice: where the contacts hold that were taken before, these faces touch."""
        return self.gain < _IMPLIED

    @property
    def parts(self) -> tuple[str, str]:
        """Manipulated, environment."""
        return self.contact.manipulated.part, self.contact.environment.part


def judge_pair(
    seen: Observation, rules: Rules, a: str, b: str, T_b: Array, pair: FacingPair, slope: Array, C: Array
) -> Candidate | None:
    """A pair of faces of parts a and b as a candidate that gains nothing yet; None beyond the thresholds.

    Args:
        T_b: Where part b is, (4, 4), world, [m].
        slope: (r, 6 n): derivative of the residual by body twists of all poses.
        C: (r, r): covariance of the residual, from the poses alone.
    """
    contact = Contact(PartFace(a, pair.a), PartFace(b, pair.b))
    play_m = seen.assembly.play(contact, seen.play_m)
    noise = reality(pair, play_m)
    most = pair_thresholds(rules, C, slack(pair, play_m), pair.lengths)
    if abs(pair.gap_m) > most.gap_m or pair.angle_rad > most.angle_rad:
        return None
    # Squared Mahalanobis length: C is of the poses, noise of play and softness of a contact that is there.
    distance = float(pair.residual @ np.linalg.solve(C + noise, pair.residual))
    is_flat = not seen.assembly.is_round(contact)
    normal = T_b[:3, :3] @ seen.assembly.face(contact.environment).normal if is_flat else np.zeros(3)
    return Candidate(contact, pair, slope, noise, most, distance, 0.0, sqrt(C[0, 0] + noise[0, 0]), normal)
