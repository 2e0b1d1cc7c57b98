"""How the faces of contacts lie to each other where parts are: overlaps of flat ones, mates of round ones."""

from collections.abc import Iterable
from typing import final

from apo_bench.assembly.poses import Poses
from apo_bench.assembly.topology import Assembly, Contact
from apo_bench.geometry import FacePair, Mate, Overlap, compute_overlaps, measure_mate

Meeting = Mate | Overlap
"""How two faces lie to each other of which one is round, or the overlap of two flat ones."""


@final
class Meetings:
    """The contacts of an assembly, measured where parts are; each contact once at the same poses."""

    def __init__(self, assembly: Assembly) -> None:
        self.assembly = assembly
        self._found = dict[tuple[Contact, bytes, bytes], Meeting]()

    def measure(self, contacts: Iterable[tuple[Contact, Poses]]) -> list[Meeting]:
        """Measure contacts; flat ones all in one call.

        Args:
            contacts: Each with the poses of the parts, world frame, [m].

        Returns:
            For each how its faces lie to each other.
        """
        pairs = list(contacts)
        keys = [(c, poses[c[0].part].tobytes(), poses[c[1].part].tobytes()) for c, poses in pairs]
        fresh = {key: pair for key, pair in zip(keys, pairs, strict=True) if key not in self._found}
        flat = {key: pair for key, pair in fresh.items() if not self.assembly.is_round(pair[0])}
        if flat:
            self._found.update(zip(flat, compute_overlaps([self._laid(*pair) for pair in flat.values()]), strict=True))
        self._found.update({key: measure_contact(self.assembly, *fresh[key]) for key in fresh.keys() - flat.keys()})
        return [self._found[key] for key in keys]

    def measure_overlaps(self, contacts: Iterable[tuple[Contact, Poses]]) -> list[Overlap]:
        """What the faces of contacts have in common, as in `measure`; nothing, if they do not look at each other."""
        return [lie.common if isinstance(lie, Mate) else lie for lie in self.measure(contacts)]

    def _laid(self, contact: Contact, poses: Poses) -> FacePair:
        m, e = contact
        return FacePair(self.assembly.face(m), poses[m.part], self.assembly.face(e), poses[e.part])


def measure_contact(assembly: Assembly, contact: Contact, poses: Poses) -> Mate:
    """How the faces of a contact lie to each other of which one is round."""
    m, e = contact
    return measure_mate(assembly.face_of(m), poses[m.part], assembly.face_of(e), poses[e.part])
