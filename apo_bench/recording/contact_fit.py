"""How well the contacts of an operation are closed where parts were seen."""

from typing import NamedTuple

import numpy as np

from apo_bench.assembly import Assembly, Contact, Poses, height, measure_round
from apo_bench.geometry import RoundFace, beside, face_area


class ContactFit(NamedTuple):
    """The worst of some contacts."""

    gap_m: float
    """From the middle of the smaller face to the plane of the other one and from beside it to it, or between axes."""
    angle_rad: float
    """Between the normal of one and the opposite of the other, or between axes."""

    @property
    def wrong_mm(self) -> float:
        """A degree counts like a millimetre."""
        return 1e3 * self.gap_m + float(np.degrees(self.angle_rad))


def contact_fit(assembly: Assembly, k: int, poses: Poses) -> ContactFit:
    """How far the contacts that operation k makes are open, if it ended with these poses, world, [m]."""
    fits = [_fit(assembly, contact, poses) for contact in assembly.operations[k].contacts]
    return ContactFit(max((fit.gap_m for fit in fits), default=0.0), max((fit.angle_rad for fit in fits), default=0.0))


def _fit(assembly: Assembly, contact: Contact, poses: Poses) -> ContactFit:
    (a, T_a), (b, T_b) = ((assembly.face_of(of), poses[of.part]) for of in contact)
    if isinstance(a, RoundFace) or isinstance(b, RoundFace):
        measured = measure_round(a, T_a, b, T_b)
        return ContactFit(abs(measured.gap_m), measured.angle_rad)
    # The middle of the smaller face is held against the larger one: how high above its plane, how far beside it.
    if face_area(a) > face_area(b):
        (a, T_a), (b, T_b) = (b, T_b), (a, T_a)
    cosine = float((T_a[:3, :3] @ a.normal) @ (T_b[:3, :3] @ b.normal))
    apart = float(np.hypot(height(a, T_a, b, T_b), beside(a, T_a, b, T_b)))
    return ContactFit(apart, float(np.arccos(np.clip(-cosine, -1.0, 1.0))))
