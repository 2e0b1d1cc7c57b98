"""Contacts of round faces: what each fixes, that the goals are the best ones, and that what is said names them."""

import gc
import weakref
from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import minimize

from apo_bench import Assembly, ContactCorrector, InputError, Observation, correct, correct_many, explain
from apo_bench.assembly import Gap, PartFace, SharedError, largest_gap, project_round_faces
from apo_bench.assembly.equations import equations
from apo_bench.correction.contact.contact import contact
from apo_bench.correction.region import contains_truth
from apo_bench.correction.solvers.play import fit_covariance
from apo_bench.geometry import pose
from apo_bench.records import with_simulated
from tests.correction.robust.test_robust import shown
from tests.round_contacts import CONTACTS, IN_BORE, LYING, MM, PLATE_AT, scene, seen, tilted, touching
from tests.shipped import BOXES

KINDS = list(CONTACTS)
BY_HAND = {
    "shaft in hole": ("x", "y", "roll", "pitch"),
    "shaft on plane": ("x", "pitch"),
    "cone in cone": ("x", "y", "z", "roll", "pitch"),
    "cone on rim": ("x", "y", "z"),
}
"""What each fixes of a pin along its own z; lying with x down it rolls, turns about x and shifts along y and z."""
METHODS = ("contact", "contact-robust", "contact-drop", "contact-refuse", "paper", "paper-track", "snap")


def case(kind, seed=0, **settings):
    given, at, _ = CONTACTS[kind]
    assembly, start, truth = scene(given, at=at)
    return seen(assembly, start, truth, np.random.default_rng(seed), **settings), truth


@pytest.mark.parametrize("kind", KINDS)
def test_each_kind_fixes_what_a_table_says(kind):
    observation, truth = case(kind)
    assert largest_gap(observation.assembly, observation.start, truth) < 1e-12
    found = explain(observation, truth).operations[1]
    assert (found.rank, found.fixed) == (CONTACTS[kind][2], BY_HAND[kind])
    _, J = equations(observation.assembly, observation.start, truth).linearised(truth)
    assert np.linalg.matrix_rank(J[:, 6:] / np.repeat([1.0, 0.04], 3), tol=1e-6) == CONTACTS[kind][2]


@pytest.mark.parametrize("kind", KINDS)
def test_jacobian_is_that_of_finite_differences(kind):
    observation, _ = case(kind)
    system = equations(observation.assembly, observation.start, observation.poses)
    _, J = system.linearised(observation.poses)
    step = 1e-6
    for column in range(12):
        xi = np.zeros((2, 6))
        xi.flat[column] = step
        ends = [system.residual(observation.poses @ pose.exp(sign * xi)) for sign in (1.0, -1.0)]
        np.testing.assert_allclose(J[:, column], (ends[0] - ends[1]) / (2 * step), atol=1e-8)


@pytest.mark.parametrize("kind", ["shaft in hole", "cone in cone", "cone on rim"])
def test_any_two_perpendicular_planes_through_an_axis_give_the_same_goals(kind):
    observation, _ = case(kind, seed=3)
    known = correct(observation).poses
    solids = observation.assembly.solids
    for turn in (0.3, 1.1, 2.5):
        toward = np.array([np.cos(turn), np.sin(turn), 0.0])
        turned = {
            name: replace(solid, rounds={key: replace(one, toward=toward) for key, one in solid.rounds.items()})
            for name, solid in solids.items()
        }
        other = replace(observation, assembly=replace(observation.assembly, solids=turned))
        np.testing.assert_allclose(correct(other).poses, known, atol=1e-9)


def violated(kind, goals):
    """What is wrong with goals, by formulas of solid geometry; lengths in m."""
    plate, pin = goals
    local = pose.inverse(plate) @ pin
    on_table = [*plate[2, :2], plate[2, 3]]
    if kind == "shaft on plane":
        ends = pose.apply(pin, np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 50 * MM]]))
        return np.array([*on_table, *(ends[:, 2] - 5 * MM)])
    if kind == "cone on rim":
        return np.array(
            [*on_table, *(pose.apply(pose.inverse(local), np.array([[0.0, 0.0, 20 * MM]]))[0] - [0, 0, 30 * MM])]
        )
    at = local[:3, 3]
    along = local[:3, 2]
    if kind == "shaft in hole":
        cuts = [(at + (z - at[2]) / along[2] * along)[:2] for z in (0.0, 20 * MM)]
        return np.array([*on_table, *np.concatenate(cuts)])
    apex = at + 25 * MM * along - [0.0, 0.0, 13 * MM]
    return np.array([*on_table, *along[:2], *apex])


@pytest.mark.parametrize("kind", KINDS)
def test_the_goals_are_those_of_an_independent_solver(kind):
    observation, truth = case(kind, seed=1)
    assert np.abs(violated(kind, truth)).max() < 1e-12
    made = correct(observation)
    assert np.abs(violated(kind, made.poses)).max() < 1e-9
    scale = np.sqrt(np.diagonal(observation.covariance, axis1=1, axis2=2))

    def goals(z):
        return observation.poses @ pose.exp(z.reshape(2, 6) * scale)

    found = minimize(
        lambda z: z @ z, np.zeros(12), jac=lambda z: 2 * z, method="SLSQP",
        constraints={"type": "eq", "fun": lambda z: 1e3 * violated(kind, goals(z))},
        options={"maxiter": 200, "ftol": 1e-14},
    )  # fmt: skip
    z = pose.log(pose.inverse(observation.poses) @ made.poses) / scale
    assert found.success
    assert (z * z).sum() == pytest.approx(found.fun, rel=1e-5)
    np.testing.assert_allclose(made.poses, goals(found.x), atol=2e-6)


@pytest.mark.parametrize("kind", KINDS)
def test_the_test_and_the_regions_hold_what_they_say(kind):
    """Of 400 draws: five standard deviations of a share of 5 % are 5.5 points; 2,000 are in the documentation."""
    rng = np.random.default_rng(5)
    observation, truth = case(kind)
    many = [seen(observation.assembly, observation.start, truth, rng) for _ in range(400)]
    made = correct_many(many, contact)
    assert all(one.ok for one in made)
    covered = [contains_truth(one, correction, truth) for one, correction in zip(many, made, strict=True)]
    assert 0.90 < np.mean(covered) < 0.99
    assert np.mean([not one.test.passes for one in made]) < 0.04


@pytest.mark.parametrize("kind", KINDS)
def test_compiled_and_plain_solvers_agree(kind):
    observation, _ = case(kind, seed=2)
    plain = ContactCorrector(compiled=False)(observation)
    np.testing.assert_allclose(contact(observation).poses, plain.poses, atol=1e-9)
    np.testing.assert_allclose(correct_many([observation, observation], contact)[1].poses, plain.poses, atol=1e-9)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("kind", KINDS)
def test_correctors_close_round_contacts(kind, method):
    observation, _ = case(kind, seed=4)
    made = correct(observation, method)
    assert made.ok, made.sentence
    assert largest_gap(observation.assembly, observation.start, made.poses) <= observation.gap_m


def test_a_missing_view_is_inferred_from_a_round_contact():
    """The taper says where the pin is, all but its turn; the shaft leaves where along its hole, and which end is up."""
    for kind, free in (("shaft in hole", [2, 5]), ("cone in cone", [5]), ("shaft on plane", [1, 2, 3, 5])):
        observation, truth = case(kind, mm=0.1, deg=0.1)
        made = correct(replace(observation, observed=np.array([True, False])), "contact-robust")
        assert made.ok, made.sentence
        assert made.left_out == (1,)
        assert made.believed.assembly is observation.assembly
        error = pose.log(pose.inverse(truth[1]) @ made.poses[1])
        if kind == "cone in cone":
            assert np.abs(np.delete(error, free)).max() < 0.01
        assert np.abs(violated(kind, made.poses)).max() < 1e-6


def test_a_wrong_relation_is_named_as_it_was_given():
    """The bore says 5 mm too far along; only the contact as given, not what stands for it, is spoken of."""
    bore = touching("pin.shaft", "plate.bore")
    top = touching("pin.bottom", "table.top")
    assembly, start, truth = scene(bore, top, at=PLATE_AT)
    plate = assembly.solids["plate"]
    wrong = replace(plate.rounds["bore"], point=np.array([8 * MM, 0.0, 0.0]))
    solids = {**assembly.solids, "plate": replace(plate, rounds={**plate.rounds, "bore": wrong})}
    observation = seen(replace(assembly, solids=solids), start, truth, np.random.default_rng(0), mm=0.5, deg=0.5)
    made = correct(observation, "contact-drop")
    assert made.dropped == ("R2: pin.shaft on plate.bore",) or made.dropped == ("R2",)
    assert {c for suspect in made.test.suspects for c in suspect.contacts} == {
        bore, top, touching("plate.bottom", "table.top"),
    }  # fmt: skip
    assert largest_gap(project_round_faces(observation.assembly), start, made.poses) > 1e-3


def test_cones_must_oppose_and_axes_need_not():
    """A pin that was seen upside down stands as well in its hole, but not in a countersink."""
    over = tilted((0.0, 0.0, 0.0), (180.0, 0.0, 0.0))
    observation, _ = case("shaft in hole")
    goals = np.array(observation.poses)
    goals[1] = goals[1] @ over
    assert correct(replace(observation, poses=goals)).ok
    observation, _ = case("cone in cone")
    goals = np.array(observation.poses)
    goals[1] = goals[1] @ over
    assert correct(replace(observation, poses=goals), "paper").status == "inconsistent"
    assert "look the same way" in correct(replace(observation, poses=goals), "paper").sentence


@pytest.mark.parametrize("kind", KINDS)
def test_far_from_the_truth_goals_are_found_and_none_longer_than_it(kind):
    """At 25 mm and degrees: other starts are made of round contacts, too."""
    for seed in range(6):
        observation, truth = case(kind, seed, mm=25.0, deg=25.0)
        made = correct(observation)
        assert made.ok, made.sentence
        scale = np.sqrt(np.diagonal(observation.covariance, axis1=1, axis2=2))
        found, true = (pose.log(pose.inverse(observation.poses) @ T) / scale for T in (made.poses, truth))
        assert (found * found).sum() <= (true * true).sum() * (1 + 1e-9)


def test_without_round_contacts_nothing_is_lowered_or_kept():
    assembly = shown(BOXES[0])[0].assembly
    assert project_round_faces(assembly) is assembly
    copy = replace(assembly)
    project_round_faces(copy)
    kept = weakref.ref(copy)
    del copy
    gc.collect()
    assert kept() is None


def test_a_hole_over_a_shaft_and_a_shaft_in_a_hole_are_the_same():
    bore = touching("pin.shaft", "plate.bore")
    assembly, start, truth = scene(bore, at=IN_BORE)
    other = scene(type(bore)(bore.environment, bore.manipulated), at=IN_BORE)[0]
    given, swapped = (seen(a, start, truth, np.random.default_rng(0)) for a in (assembly, other))
    np.testing.assert_allclose(correct(given).poses, correct(swapped).poses, atol=1e-12)
    assert {project_round_faces(other).given(r.contact) for r in project_round_faces(other).relations()} == {
        contact for operation in other.operations for contact in operation.contacts
    }


@pytest.mark.parametrize(("radius", "fit", "play"), [(5.0, True, 0.25), (5.1, False, 0.1), (5.1, True, 0.35)])
def test_play_of_a_round_fit_is_a_disc(radius, fit, play):
    """What shapes leave adds to the clearance; a component of a point in a disc of radius c deviates by c / 2."""
    bore = touching("pin.shaft", "plate.bore")
    assembly, start, truth = scene(bore, at=IN_BORE, fit=fit, radius=radius * MM)
    assert assembly.play(bore, 0.25e-3) == pytest.approx(play * MM)
    S = fit_covariance(project_round_faces(assembly), 0.25e-3)
    number = [
        i
        for i, r in enumerate(project_round_faces(assembly).relations())
        if project_round_faces(assembly).given(r.contact) == bore
    ]
    rows = S[np.ix_([3 * i for i in number], [3 * i for i in number])]
    np.testing.assert_allclose(rows, np.eye(2) * 2 * (play * MM) ** 2 / 4, rtol=1e-9, atol=1e-20)
    gaps = {bore: Gap("clearance")}
    loose = scene(bore, at=IN_BORE, fit=fit, radius=radius * MM, gaps=gaps)[0]
    for seed in range(4):
        made = correct(seen(loose, start, truth, np.random.default_rng(seed), play_m=0.25e-3))
        assert made.ok
        local = pose.inverse(made.poses[0]) @ made.poses[1]
        at = local[:3, 3]
        along = local[:3, 2]
        ends = [(at + (z - at[2]) / along[2] * along)[:2] for z in (0.0, 20 * MM)]
        far = max(np.linalg.norm(ends, axis=1))
        assert np.cos(np.pi / 16) * play * MM - 1e-6 <= far <= play * MM + 1e-6


def test_a_cone_that_recedes_lets_its_shaft_in_deeper():
    """At 45 degrees by root two of the clearance, along the axis."""
    sits = touching("pin.taper", "plate.sink")
    assembly = scene(sits, at=CONTACTS["cone in cone"][1])[0]
    plate = assembly.solids["plate"]
    fit = replace(plate, rounds={**plate.rounds, "sink": replace(plate.rounds["sink"], fit=True)})
    low = project_round_faces(replace(assembly, solids={**assembly.solids, "plate": fit}))
    plays = [low.play(r.contact, 0.1e-3) for r in low.relations() if low.given(r.contact) == sits]
    assert plays == pytest.approx([0.1e-3, 0.1e-3, np.sqrt(2) * 0.1e-3])


@pytest.mark.parametrize("mm", [0.02, 0.5])
def test_a_shaft_that_stands_anywhere_in_its_play_is_no_alarm(mm):
    """Of 300 draws with both ends somewhere in a disc of 0.25 mm, at a nominal 1 %."""
    bore = touching("pin.shaft", "plate.bore")
    c = 0.25 * MM
    assembly, start, _ = scene(bore, at=IN_BORE, fit=True)
    rng = np.random.default_rng(3)
    many = []
    for _ in range(300):
        radius = c * np.sqrt(rng.uniform(size=2))
        angle = rng.uniform(0.0, 2 * np.pi, 2)
        low, high = (
            np.array([r * np.cos(a), r * np.sin(a), z]) for r, a, z in zip(radius, angle, (0, 20 * MM), strict=True)
        )
        axis = (high - low) / np.linalg.norm(high - low)
        off = pose.inverse(PLATE_AT) @ IN_BORE
        x = off[:3, 0] - (off[:3, 0] @ axis) * axis
        off[:3, :3] = np.column_stack([x / np.linalg.norm(x), np.cross(axis, x / np.linalg.norm(x)), axis])
        off[:3, 3] = low + axis * off[2, 3] / axis[2]
        many.append(seen(assembly, start, np.array([PLATE_AT, PLATE_AT @ off]), rng, mm, mm, play_m=c))
    made = correct_many(many, contact)
    assert all(one.ok for one in made)
    assert np.mean([not one.test.passes for one in made]) <= 0.03
    told_nothing = correct_many([replace(one, play_m=0.0) for one in many], contact)
    assert mm > 0.1 or np.mean([not one.test.passes for one in told_nothing]) > 0.5


def test_parts_of_any_pieces_settle():
    """A pin seen 2 mm above where it lies comes down."""
    observation, truth = case("shaft on plane", mm=1e-3, deg=1e-3)
    raised = np.array(observation.poses)
    raised[1, 2, 3] += 2 * MM
    made = correct(replace(observation, poses=raised), with_simulated("physics-settle"))
    assert made.ok, made.sentence
    assert made.poses[1, 2, 3] == pytest.approx(truth[1, 2, 3], abs=0.1 * MM)


@pytest.mark.parametrize(
    ("kind", "gap"),
    [
        ("shaft in hole", Gap("contact")),
        ("shaft in hole", Gap("clearance", -1e-4, 2e-4)),
        ("cone in cone", Gap("clearance")),
    ],
)
def test_gaps_that_round_faces_cannot_have_are_refused(kind, gap):
    given, at, _ = CONTACTS[kind]
    assembly, start, truth = scene(given, at=at, gaps={given: gap})
    with pytest.raises(InputError, match="pin"):
        correct(seen(assembly, start, truth, np.random.default_rng(0)))


def test_errors_that_operations_share_are_used():
    """A camera that is off as a whole leaves how the parts stand to each other exact."""
    observation, truth = case("shaft in hole")
    C = np.diag(np.repeat([5 * MM, np.radians(2.0)], 3) ** 2)
    off = pose.exp(np.array([4, -3, 2, 0.02, -0.02, 0.03]) * np.repeat([MM, 1.0], 3))
    shared = SharedError("camera", (0, 1), C, np.eye(4))
    goals = off @ truth
    Ad = pose.adjoint(pose.inverse(goals))
    both = replace(
        observation, poses=goals, shared=(shared,), covariance=Ad @ C @ np.swapaxes(Ad, 1, 2) + np.eye(6) * 1e-10
    )
    made = correct(both)
    assert made.ok, made.sentence
    apart = pose.inverse(pose.inverse(truth[0]) @ truth[1]) @ pose.inverse(made.poses[0]) @ made.poses[1]
    assert np.abs(pose.log(apart)).max() < 1e-4


def test_a_look_settles_what_a_round_contact_leaves_open():
    observation, truth = case("shaft in hole", mm=0.3, deg=0.3)
    goals = np.array(observation.poses)
    goals[1] = goals[1] @ tilted((80.0, 40.0, 30.0), (90.0, 20.0, 0.0))

    class Again:
        left = 3

        def __call__(self, operations):
            self.left -= 1
            fresh = seen(observation.assembly, observation.start, truth, np.random.default_rng(self.left), 0.3, 0.3)
            return replace(fresh, observed=np.isin(np.arange(2), operations))

    made = correct(replace(observation, poses=goals), "contact-robust", Again())
    assert made.ok, made.sentence
    assert np.abs(pose.log(pose.inverse(truth) @ made.poses)[:, :3]).max() < 2 * MM


def test_a_lying_shaft_rolls_and_a_roof_of_two_planes_holds_it_on_a_line():
    """Two planes at right angles fix four directions of a shaft: it shifts along the groove and rolls."""
    low = scene(touching("pin.shaft", "table.top"), at=LYING)
    assembly, start, truth = low
    wall = replace(assembly.solids["table"].faces["top"], name="side", outline=np.array(
        [[-65, -300, -300], [-65, 300, -300], [-65, 300, 300], [-65, -300, 300]]
    ) * MM)  # fmt: skip
    solids = {
        **assembly.solids,
        "table": replace(assembly.solids["table"], faces={**assembly.solids["table"].faces, "side": wall}),
    }
    contacts = (touching("pin.shaft", "table.top"), touching("pin.shaft", "table.side"))
    operations = (assembly.operations[0], replace(assembly.operations[1], contacts=contacts))
    groove = Assembly(solids, operations, assembly.fixed)
    truth = np.array([truth[0], tilted((-60.0, 10.0, 5.0), (90.0, 0.0, 0.0))])
    assert largest_gap(groove, start, truth) < 1e-12
    observation = Observation(groove, start, truth, np.tile(np.eye(6) * 1e-6, (2, 1, 1)), np.ones(2, bool))
    assert explain(observation, truth).operations[1].rank == 4


def test_a_corrector_of_ones_own_gets_the_round_faces():
    observation, _ = case("cone in cone")
    given = []

    def own(seen):
        given.append(seen)
        return seen.poses

    correct(observation, own)
    assert given[0].assembly is observation.assembly


def test_sheets_are_of_no_part():
    observation, _ = case("shaft in hole")
    low = project_round_faces(observation.assembly)
    assert low.solids["plate"] is observation.assembly.solids["plate"]
    assert all("|" in of.face for r in low.relations()[1:] for of in r.contact)
    assert PartFace("plate", "bore") not in low.sheets
