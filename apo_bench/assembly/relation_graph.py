"""The relation graph of Sections 3.1, 3.2.2 and 3.3: parts at their placements, and the contacts between them (Fig. 7).

A part that is moved again, also when it is carried, becomes a new node. An arc that stands joins the nodes its parts
have now; one that disappeared joins those they had when it was made, and keeps them in the graph.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import final

from apo_bench.assembly.equations import build_contact_equations, find_largest_residual
from apo_bench.assembly.observation import Observation
from apo_bench.assembly.poses import Poses
from apo_bench.assembly.round_contacts_as_planes import project_round_faces
from apo_bench.assembly.topology import ODL, Assembly, Contact, Gap, Relation, invert, simplify_odl, spell
from apo_bench.errors import require
from apo_bench.geometry import Array

ArcResiduals = Sequence[float | None]
"""The largest |e| of every arc, [m]; None where an operation was not observed."""


@final
@dataclass(frozen=True)
class Node:
    """A part at one of its placements."""

    part: str
    placed: int | None
    """The operation that put it there, counted from 0; None for a part that was never moved."""
    odl: ODL
    """The product of motion parameters that gives its pose; empty for a part that was never moved."""

    def __str__(self) -> str:
        """`cube2 (6): T6 T5^-1 T2`; a part that was never moved has the T0 of the paper's work table."""
        if self.placed is None:
            return f"{self.part}: T0"
        return f"{self.part} ({self.placed + 1}): {spell(self.odl)}"


@final
@dataclass(frozen=True)
class Arc:
    """All contacts that one operation made between two parts."""

    name: str
    """R1, R2, ... in the order in which they were made."""
    manipulated: Node
    environment: Node
    contacts: tuple[Contact, ...]
    made: int
    """The operation that made them, counted from 0."""
    lost: int | None
    """The operation at which they disappeared, or None while they stand."""
    gaps: tuple[Gap, ...] = ()
    """The requested gap of each contact; empty: `centred` for all."""
    axial: bool = False
    """Whether a contact has a round face."""

    def __str__(self) -> str:
        return f"{self.name} {self.manipulated.part} -> {self.environment.part}"

    @property
    def pairs(self) -> tuple[str, ...]:
        """The faces in contact, manipulated first: `nz-top`; with the requested gap, if it is not `centred`."""
        gaps = self.gaps or (Gap(),) * len(self.contacts)
        return tuple(
            f"{contact.manipulated.face}-{contact.environment.face}{'' if gap == Gap() else f' ({gap})'}"
            for contact, gap in zip(self.contacts, gaps, strict=True)
        )

    @property
    def operations(self) -> frozenset[int]:
        """The operations whose motion parameters occur in the equations D_a^-1 D_b of this arc (Eq. 26)."""
        word = simplify_odl((*invert(self.manipulated.odl), *self.environment.odl))
        return frozenset(term.operation for term in word)


@final
@dataclass(frozen=True)
class Graph:
    """The relation graph after some operations."""

    step: int
    """Number of operations done."""
    nodes: tuple[Node, ...]
    """Parts that were never moved first, then in the order of placement, main parts before the parts they carried."""
    arcs: tuple[Arc, ...]

    def is_current(self, node: Node) -> bool:
        """Whether the part is still where this node puts it."""
        return not any(
            other.part == node.part and _placing_operation(other) > _placing_operation(node) for other in self.nodes
        )


def build_relation_graph(assembly: Assembly, step: int | None = None) -> Graph:
    """The graph after `step` operations (None: all of them).

    Nodes are the fixed parts, the parts that were moved, and the ends of arcs.

    Raises:
        InputError: There is no such step.
    """
    count = len(assembly) if step is None else step
    require(
        1 <= count <= len(assembly),
        f"step {count} was given, the demonstration has {len(assembly)} operations; give a step "
        f"from 1 to {len(assembly)}.",
    )
    done = assembly.first(count)
    history = _list_nodes_by_step(done)
    arcs = _list_arcs(done, history)
    present = [node for node in history[-1].values() if node.placed is not None or node.part in done.fixed]
    joined = [node for arc in arcs for node in (arc.manipulated, arc.environment)]
    # By time of placement; the main part of an operation, whose ODL is a single T, before the parts it carried.
    nodes = sorted(dict.fromkeys([*present, *joined]), key=lambda node: (_placing_operation(node), len(node.odl)))
    return Graph(len(done), tuple(nodes), arcs)


def compute_arc_residuals(assembly: Assembly, start: Poses, poses: Array, graph: Graph) -> tuple[float, ...]:
    """The largest |e| of every arc, [m], at `poses` (n, 4, 4), world frame, [m] (Section 3.3)."""
    done = project_round_faces(assembly.first(graph.step))
    reached = poses[: graph.step]
    gaps = build_contact_equations(done, start, reached).gaps(reached)
    named = [(relation.made, done.given(relation.contact)) for relation in done.relations()]
    mine = [[made == arc.made and contact in arc.contacts for made, contact in named] for arc in graph.arcs]
    return tuple(find_largest_residual(gaps[chosen]) for chosen in mine)


def compute_observed_residuals(observation: Observation, graph: Graph) -> tuple[float | None, ...]:
    """The largest |e| of every arc at the observed poses, [m]; None if it needs an operation that was not observed."""
    residuals = compute_arc_residuals(observation.assembly, observation.start, observation.poses, graph)
    known = [all(observation.observed[k] for k in arc.operations) for arc in graph.arcs]
    return tuple(r if whole else None for r, whole in zip(residuals, known, strict=True))


def _list_nodes_by_step(assembly: Assembly) -> list[dict[str, Node]]:
    """The node of every part before the first operation, and after each."""
    now = {part: Node(part, None, ()) for part in assembly.solids}
    history = [now]
    for k, (operation, odls) in enumerate(zip(assembly.operations, assembly.odls(), strict=True)):
        now = now | {part: Node(part, k, odls[part]) for part in operation.moves}
        history.append(now)
    return history


def _list_arcs(assembly: Assembly, history: list[dict[str, Node]]) -> tuple[Arc, ...]:
    """One arc for each pair of parts that an operation brings into contact.

    Args:
        history: As returned by `_list_nodes_by_step`.
    """
    together: dict[tuple[int, str, str], list[Relation]] = {}
    for relation in assembly.relations():
        manipulated, environment = relation.contact
        together.setdefault((relation.made, manipulated.part, environment.part), []).append(relation)
    arcs = []
    for i, ((made, a, b), relations) in enumerate(together.items(), start=1):
        lost = relations[0].lost
        nodes = history[-1 if lost is None else made + 1]
        contacts = tuple(r.contact for r in relations)
        gaps = tuple(assembly.gaps.get(contact, Gap()) for contact in contacts)
        arcs.append(Arc(f"R{i}", nodes[a], nodes[b], contacts, made, lost, gaps, any(map(assembly.is_round, contacts))))
    return tuple(arcs)


def _placing_operation(node: Node) -> int:
    """The operation that placed a node, -1 for a part that was never moved: a sort key."""
    return -1 if node.placed is None else node.placed
