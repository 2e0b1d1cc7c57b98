"""Measurements of contacts at given poses, cached: overlaps of flat faces, mates of round faces."""

from collections.abc import Iterable
from typing import final

from apo_bench.assembly.poses import Poses
from apo_bench.assembly.topology import Assembly, Contact
from apo_bench.geometry import FacePair, Mate, Overlap, compute_overlaps, measure_mate

OverlapOrMate = Mate | Overlap
"""The overlap of two flat faces, or the relative pose of two faces of which one is round."""


@final
class ContactMeasurements:
    """Measures the contacts of an assembly; each contact is measured once per pair of poses."""

    def __init__(self, assembly: Assembly) -> None:
        self.assembly = assembly
        self._found = dict[tuple[Contact, bytes, bytes], OverlapOrMate]()

    def measure(self, contacts: Iterable[tuple[Contact, Poses]]) -> list[OverlapOrMate]:
        """Measure contacts; all flat ones in one call, to save time.

        Args:
            contacts: Each with the poses of the parts, world frame, [m].

        Returns:
            The measurement of each, in order.
        """
        pairs = list(contacts)
        # A contact depends on the poses of its two parts alone, whose bytes serve as a key.
        keys = [(c, poses[c[0].part].tobytes(), poses[c[1].part].tobytes()) for c, poses in pairs]
        fresh = {key: pair for key, pair in zip(keys, pairs, strict=True) if key not in self._found}
        flat = {key: pair for key, pair in fresh.items() if not self.assembly.is_round(pair[0])}
        if flat:
            self._found.update(
                zip(flat, compute_overlaps([self._pair_of_contact(*pair) for pair in flat.values()]), strict=True)
            )
        self._found.update(
            {key: measure_round_contact(self.assembly, *fresh[key]) for key in fresh.keys() - flat.keys()}
        )
        return [self._found[key] for key in keys]

    def measure_overlaps(self, contacts: Iterable[tuple[Contact, Poses]]) -> list[Overlap]:
        """The overlap of the faces of each contact; empty if they do not face each other."""
        return [lie.common if isinstance(lie, Mate) else lie for lie in self.measure(contacts)]

    def _pair_of_contact(self, contact: Contact, poses: Poses) -> FacePair:
        """The faces of a flat contact with their poses, the manipulated one laid on the other."""
        m, e = contact
        return FacePair(self.assembly.face(m), poses[m.part], self.assembly.face(e), poses[e.part])


def measure_round_contact(assembly: Assembly, contact: Contact, poses: Poses) -> Mate:
    """Measure a contact of which at least one face is round."""
    m, e = contact
    return measure_mate(assembly.face_of(m), poses[m.part], assembly.face_of(e), poses[e.part])
