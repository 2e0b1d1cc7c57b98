"""How the faces of contacts lie to each other where parts are: overlaps of flat ones, mates of round ones."""

from collections.abc import Iterable

from apo_bench.assembly.poses import Poses
from apo_bench.assembly.topology import Assembly, Contact
from apo_bench.geometry import Laid, Mate, Overlap, mate, overlaps


def meet(assembly: Assembly, contacts: Iterable[tuple[Contact, Poses]]) -> list[Mate | Overlap]:
    """Measure contacts, each where its parts are; flat ones all in one call.

    Args:
        contacts: Each with the poses of the parts, world frame, [m].

    Returns:
        For each the overlap of two flat faces, or how a round one lies to the other.
    """
    pairs = list(contacts)
    laid = [
        Laid(assembly.face(m), poses[m.part], assembly.face(e), poses[e.part])
        for (m, e), poses in pairs
        if not assembly.is_round(Contact(m, e))
    ]
    flat = iter(overlaps(laid))
    return [measure_mate(assembly, *pair) if assembly.is_round(pair[0]) else next(flat) for pair in pairs]


def common_overlaps(assembly: Assembly, contacts: Iterable[tuple[Contact, Poses]]) -> list[Overlap]:
    """What the faces of contacts have in common, as in `meet`; nothing, if they do not look at each other."""
    return [each.common if isinstance(each, Mate) else each for each in meet(assembly, contacts)]


def measure_mate(assembly: Assembly, contact: Contact, poses: Poses) -> Mate:
    """How the faces of a contact lie to each other of which one is round."""
    m, e = contact
    return mate(assembly.face_of(m), poses[m.part], assembly.face_of(e), poses[e.part])
