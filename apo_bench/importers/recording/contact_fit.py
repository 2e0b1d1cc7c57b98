"""Measure how far the contacts of an operation are open at given poses."""

from collections.abc import Collection
from typing import NamedTuple

import numpy as np

from apo_bench.assembly import Assembly, Contact, Poses, measure_height, measure_round_pair
from apo_bench.geometry import RoundFace, measure_face_area, measure_lateral_gap


class ContactFit(NamedTuple):
    """The misfit of contacts; of several contacts the largest gap and the largest angle."""

    gap_m: float
    """Distance of the centre of the smaller face from the other face; for round faces as in `measure_round_pair`."""
    angle_rad: float
    """Angle between one normal and the opposite of the other; for round faces between axes."""

    @property
    def wrong_mm(self) -> float:
        """Gap plus angle, [mm]; a degree counts like a millimetre."""
        return 1e3 * self.gap_m + float(np.degrees(self.angle_rad))


def contact_fit(assembly: Assembly, k: int, poses: Poses, unknown: Collection[str] = ()) -> ContactFit:
    """Measure how far the contacts of operation k are open at poses, world, [m].

    Args:
        unknown: Parts whose poses are not known; their contacts do not count.
    """
    contacts = [each for each in assembly.operations[k].contacts if not {face.part for face in each} & {*unknown}]
    fits = [ContactFit(0.0, 0.0), *(_measure(assembly, contact, poses) for contact in contacts)]
    return ContactFit(max(fit.gap_m for fit in fits), max(fit.angle_rad for fit in fits))


def _measure(assembly: Assembly, contact: Contact, poses: Poses) -> ContactFit:
    """Measure the misfit of one contact."""
    (a, T_a), (b, T_b) = ((assembly.face_of(of), poses[of.part]) for of in contact)
    if isinstance(a, RoundFace) or isinstance(b, RoundFace):
        measured = measure_round_pair(a, T_a, b, T_b)
        return ContactFit(abs(measured.gap_m), measured.angle_rad)
    # From the centre of the smaller face: height above the plane of the larger one, and distance outside its outline.
    if measure_face_area(a) > measure_face_area(b):
        (a, T_a), (b, T_b) = (b, T_b), (a, T_a)
    cosine = float((T_a[:3, :3] @ a.normal) @ (T_b[:3, :3] @ b.normal))
    apart = float(np.hypot(measure_height(a, T_a, b, T_b), measure_lateral_gap(a, T_a, b, T_b)))
    return ContactFit(apart, float(np.arccos(np.clip(-cosine, -1.0, 1.0))))
