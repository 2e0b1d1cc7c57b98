"""Do the test and the posterior of `contact` hold for round faces? `python benchmarks/round_contacts.py` (a minute).

A plate is put on a table and a pin, a plug or a stepped pin onto or into it, by each kind of contact. Static draws of
isotropic noise of 1 mm and 1 degree, all of them corrected at once. Of each kind: how many directions it fixes, how far
positions are off as seen and corrected, how often the test fails at a nominal 1 %, whether its p-values are uniform
(Kolmogorov and Smirnov), and how often 95 % regions of the goals cover the truth. Writes the table in
docs/how/contact.md.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")

import argparse
from pathlib import Path

import numpy as np
from scipy.stats import kstest

from apo_bench.assembly import Assembly, Contact, Observation, Operation, PartFace, largest_gap
from apo_bench.correction.contact.contact import contact
from apo_bench.correction.correctors import correct_many
from apo_bench.correction.explanation import explain
from apo_bench.correction.region import contains_truth
from apo_bench.geometry import Array, RoundFace, Solid, pose
from apo_bench.parts.making import Frustum, bore, extrude, rectangle, solid_of, turned

PAGE = Path(__file__).parent.parent / "docs" / "how" / "contact.md"
BEGIN = "<!-- table: python benchmarks/round_contacts.py -->"
END = "<!-- end of table -->"
DEVIATIONS = np.repeat([1e-3, np.radians(1.0)], 3)
PLATE = pose.at((0.03, 0.02, 0.0), (0.0, 0.0, 25.0))
TURN = (0.0, 0.0, 70.0)
KINDS: dict[str, tuple[str, str, Array]] = {
    "shaft in hole": ("wall", "plate.bore", PLATE @ pose.at((0.0, 0.0, 0.003), TURN)),
    "shaft on plane": ("wall", "table.top", pose.at((-0.1, 0.01, 0.005), (0.0, 90.0, 20.0))),
    "cone in cone": ("cone", "plate.bore_chamfer_high", PLATE @ pose.at((0.0, 0.0, -0.012), TURN)),
    "cone on rim": ("cone", "plate.rim", PLATE @ pose.at((0.0, 0.0, -0.01), TURN)),
}
"""Kind -> the face of the pin, what it touches, where the pin is then."""


def main() -> None:
    asked = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    asked.add_argument("--draws", type=int, default=2000, help="of each kind")
    text = table(asked.parse_args().draws)
    print(text)
    head, rest = PAGE.read_text(encoding="utf-8").split(BEGIN)
    PAGE.write_text(f"{head}{BEGIN}\n\n{text}\n\n{END}{rest.split(END, 1)[1]}", encoding="utf-8")


def table(draws: int) -> str:
    head = "| contact | draws | fixes | seen, mm | corrected, mm | alarms at 1 % | p uniform | regions cover |"
    return "\n".join([head, "|---" * 8 + "|", *(row(kind, draws) for kind in KINDS)])


def row(kind: str, draws: int) -> str:
    assembly, start, truth = scene(kind)
    assert largest_gap(assembly, start, truth) < 1e-9
    rng = np.random.default_rng([17, list(KINDS).index(kind)])
    C = np.tile(np.diag(DEVIATIONS**2), (2, 1, 1))
    seen = []
    for _ in range(draws):
        goals = truth @ pose.inverse(pose.exp(rng.standard_normal((2, 6)) * DEVIATIONS))
        seen.append(Observation(assembly, start, goals, C, np.ones(2, dtype=np.bool_)))
    made = correct_many(seen, contact)
    assert all(one.ok for one in made)
    p = np.array([one.test.p_value for one in made if one.test is not None])
    covered = np.mean([contains_truth(one, c, truth) for one, c in zip(seen, made, strict=True)])
    fixes = explain(seen[0], truth).operations[1].rank
    off = [rms([one.goals - truth for one in some]) for some in (seen, made)]
    numbers = f"{off[0]:.2f} | {off[1]:.2f} | {100 * np.mean(p < 0.01):.1f} % | {kstest(p, 'uniform').pvalue:.2g}"
    return f"| {kind} | {draws} | {fixes} | {numbers} | {100 * covered:.1f} % |"


def rms(off: list[Array]) -> float:
    """Root mean square of positions, [mm]."""
    return float(1e3 * np.sqrt(np.square(np.array(off)[:, :, :3, 3]).sum(axis=2).mean()))


def scene(kind: str) -> tuple[Assembly, dict[str, Array], Array]:
    """The assembly, where parts start, and the true goals."""
    face, touched, at = KINDS[kind]
    contact = Contact(PartFace("pin", face), PartFace(*touched.split(".")))
    below = Contact(PartFace("plate", "bottom"), PartFace("table", "top"))
    body = turned([Frustum(0, 30, 5, name="wall"), Frustum(30, 40, 5, 15, name="cone")], flats={0: "end", 40: "head"})
    parts = {"table": solid_of("table", extrude(rectangle(600, 600), -20, 0, top="top")), "plate": plate()}
    operations = (Operation("plate", (below,)), Operation("pin", (contact,)))
    start = {"table": np.eye(4), "plate": pose.at((0.2, 0.0, 0.0)), "pin": pose.at((0.0, 0.2, 0.0))}
    solids = {**parts, "pin": solid_of("pin", body)}
    return Assembly(solids, operations, frozenset({"table"})), start, np.array([PLATE, at])


def plate() -> Solid:
    """A plate of 20 mm with a bore of 5 mm and a chamfer of 2 mm, or without one a rim at its top."""
    hole = bore((0, 0), 5, 0, 20, "bore", chamfer_high=2)
    solid = solid_of("plate", extrude(rectangle(40, 40), 0, 20, bores=[hole], bottom="bottom", top="top"))
    rim = RoundFace("rim", np.array([0.0, 0.0, 0.02]), np.array([0.0, 0.0, 1.0]), (0.0, 0.0), (5e-3, 5e-3), hole=True)
    return Solid(
        solid.name, solid.faces, solid.pieces, solid.centroid, solid.volume, {**solid.rounds, "rim": rim}, solid.inertia
    )


if __name__ == "__main__":
    main()
