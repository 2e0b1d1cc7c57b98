"""Observations and corrections as messages, and back; what comes back may have been made by anybody."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import astuple
from typing import Any

import numpy as np

from apo_bench.assembly.correction_record import Consistency, Correction, Iterate, Suspect, Try
from apo_bench.assembly.goals import Observation, Step
from apo_bench.assembly.outlier_model import OutlierModel
from apo_bench.assembly.shared_error import SharedError
from apo_bench.assembly.tails import Tails
from apo_bench.assembly.topology import Assembly, Contact, Gap, Operation, PartFace
from apo_bench.correction.own_code.message import Arrays, CorrectorMessage, GarbledMessage, MessageForm
from apo_bench.geometry.hull import Cylinder, Hull
from apo_bench.geometry.round_face import RoundFace
from apo_bench.geometry.solid import Box, Face, Piece, Solid


def observation_message(observation: Observation) -> CorrectorMessage:
    """All that a corrector may use."""
    assembly = observation.assembly
    parts = list(observation.start)
    form = {
        "solids": [[part, _solid_form(solid)] for part, solid in assembly.solids.items()],
        "operations": [
            [op.main, [_ends(contact) for contact in op.contacts], op.carries] for op in assembly.operations
        ],
        "fixed": sorted(assembly.fixed),
        "gaps": [[_ends(contact), gap] for contact, gap in assembly.gaps.items()],
        "parts": parts,
        "gap_m": float(observation.gap_m),
        "play_m": float(observation.play_m),
        "outliers": None if observation.outliers is None else [*map(float, astuple(observation.outliers))],
        "shared": [_shared_form(one) for one in observation.shared],
        "tails": None if observation.tails is None else _tails_form(observation.tails),
    }
    start = np.array([observation.start[part] for part in parts]).reshape(-1, 4, 4)
    return form, {
        "start": start,
        "goals": observation.goals,
        "covariance": observation.covariance,
        "seen": observation.seen,
    }


def parse_observation(form: MessageForm, arrays: Arrays) -> Observation:
    """The observation of such a message."""
    assembly = Assembly(
        solids={part: _solid(solid) for part, solid in form["solids"]},
        operations=tuple(
            Operation(main, tuple(map(_contact, contacts)), tuple(carries))
            for main, contacts, carries in form["operations"]
        ),
        fixed=frozenset(form["fixed"]),
        gaps={_contact(ends): Gap(*gap) for ends, gap in form["gaps"]},
    )
    start = dict(zip(form["parts"], arrays["start"], strict=True))
    return Observation(
        assembly,
        start,
        goals=arrays["goals"],
        covariance=arrays["covariance"],
        seen=arrays["seen"],
        gap_m=form["gap_m"],
        play_m=form["play_m"],
        outliers=None if form["outliers"] is None else OutlierModel(*form["outliers"]),
        shared=tuple(SharedError(**one) for one in form["shared"]),
        tails=None if form["tails"] is None else Tails(**form["tails"]),
    )


def correction_message(correction: Correction) -> CorrectorMessage:
    """What a corrector returned.

    Raises:
        TypeError, ValueError: It holds what is no number, or no text, where one is needed.
    """
    form = {
        "status": correction.status,
        "sentence": correction.sentence,
        "freed": [int(k) for k in _several(correction.freed)],
        "gaps": [float(correction.gap_before_m), float(correction.gap_after_m)],
        "rank": int(correction.rank),
        "trace": [[float(gap), int(rank), float(step)] for gap, rank, step in correction.trace],
        "tried": [
            [int(one.step), [int(k) for k in _several(one.free)], float(one.gap_m)] for one in _tries(correction.tried)
        ],
        "schedule": [[int(k), bool(undo)] for k, undo in correction.schedule],
        "test": _test_form(correction.test),
        "test_after": _test_form(correction.test_after),
        "dropped": [str(name) for name in _several(correction.dropped)],
        "left_out": [int(k) for k in _several(correction.left_out)],
    }
    possible = {"goals": correction.goals, "targets": correction.targets, "covariance": correction.covariance}
    return form, {name: array for name, array in possible.items() if array is not None}


def parse_correction(form: MessageForm, arrays: Arrays) -> Correction:
    """The correction of such a message.

    Raises:
        GarbledMessage: It is none, or a number is not finite where one must be.
    """
    try:
        before, after = map(_number, form["gaps"])
        return Correction(
            goals=arrays["goals"],
            status=_text(form["status"]),
            sentence=_text(form["sentence"]),
            freed=tuple(map(_whole, form["freed"])),
            gap_before_m=before,
            gap_after_m=after,
            rank=_whole(form["rank"]),
            trace=tuple(Iterate(_number(gap), _whole(rank), _number(step)) for gap, rank, step in form["trace"]),
            tried=tuple(Try(_whole(step), tuple(map(_whole, free)), _number(gap)) for step, free, gap in form["tried"]),
            schedule=tuple(Step(_whole(k), undo is True) for k, undo in form["schedule"]),
            targets=arrays.get("targets"),
            test=_test(form["test"]),
            test_after=_test(form["test_after"]),
            covariance=arrays.get("covariance"),
            dropped=tuple(map(_text, form["dropped"])),
            left_out=tuple(map(_whole, form["left_out"])),
        )
    except (ValueError, TypeError, KeyError, IndexError, OverflowError) as error:
        raise GarbledMessage("the message is no correction") from error


def _shared_form(one: SharedError) -> MessageForm:
    return {
        "name": one.name,
        "operations": list(one.operations),
        "covariance": one.covariance.tolist(),
        "frame": None if one.frame is None else one.frame.tolist(),
        "local": bool(one.local),
        "correlation": None if one.correlation is None else one.correlation.tolist(),
    }


def _tails_form(tails: Tails) -> MessageForm:
    arrays = ("frames", "scales", "freedom", "variances", "limits")
    return {**{name: getattr(tails, name).tolist() for name in arrays}, "joined": bool(tails.joined)}


def _solid_form(solid: Solid) -> MessageForm:
    return {
        "name": solid.name,
        "faces": [
            [key, face.name, face.outline.tolist(), [hole.tolist() for hole in face.holes], bool(face.fit)]
            for key, face in solid.faces.items()
        ],
        "pieces": [_piece_form(piece) for piece in solid.pieces],
        "centroid": solid.centroid.tolist(),
        "volume": float(solid.volume),
        "rounds": [[key, _round_form(face)] for key, face in solid.rounds.items()],
        "inertia": None if solid.inertia is None else solid.inertia.tolist(),
    }


def _solid(form: MessageForm) -> Solid:
    return Solid(
        form["name"],
        {key: Face(name, outline, tuple(holes), fit) for key, name, outline, holes, fit in form["faces"]},
        tuple(map(_piece, form["pieces"])),
        form["centroid"],
        form["volume"],
        {
            key: RoundFace(**{**face, "span": tuple(face["span"]), "radii": tuple(face["radii"])})
            for key, face in form["rounds"]
        },
        form["inertia"],
    )


def _piece_form(piece: Piece) -> list[Any]:
    if isinstance(piece, Box):
        return ["box", piece.name, piece.center.tolist(), piece.half.tolist()]
    round_ = piece.cylinder
    cylinder = None if round_ is None else [round_.center.tolist(), round_.axis.tolist(), *map(float, round_[2:])]
    return ["hull", piece.name, piece.corners.tolist(), cylinder]


def _piece(form: list[Any]) -> Piece:
    kind, name, *shape = form
    if kind == "box":
        return Box(name, *shape)
    corners, cylinder = shape
    if cylinder is None:
        return Hull(name, corners)
    center, axis, radius, half_length = cylinder
    return Hull(name, corners, Cylinder(np.array(center), np.array(axis), radius, half_length))


def _round_form(face: RoundFace) -> MessageForm:
    return {
        "name": face.name,
        "point": face.point.tolist(),
        "axis": face.axis.tolist(),
        "span": [*map(float, face.span)],
        "radii": [*map(float, face.radii)],
        "hole": bool(face.hole),
        "fit": bool(face.fit),
        "extent_rad": float(face.extent_rad),
        "toward": None if face.toward is None else face.toward.tolist(),
    }


def _ends(contact: Contact) -> list[list[str]]:
    return [list(end) for end in contact]


def _contact(ends: Sequence[Sequence[str]]) -> Contact:
    manipulated, environment = ends
    return Contact(*(PartFace(_text(part), _text(face)) for part, face in (manipulated, environment)))


def _test_form(test: Consistency | None) -> list[Any] | None:
    if test is None:
        return None
    suspects = [
        [
            *(str(one.relation), [_ends(contact) for contact in one.contacts], int(one.made)),
            *(float(one.chi_square), int(one.freedom), float(one.p_value)),
        ]
        for one in test.suspects
    ]
    return [float(test.chi_square), int(test.freedom), float(test.p_value), float(test.level), suspects]


def _test(form: Any) -> Consistency | None:
    if form is None:
        return None
    chi_square, freedom, p_value, level, suspects = form
    found = [
        Suspect(
            *(_text(relation), tuple(map(_contact, contacts)), _whole(made)),
            *(_number(length), _whole(rank), _number(p)),
        )
        for relation, contacts, made, length, rank, p in suspects
    ]
    return Consistency(_number(chi_square), _whole(freedom), _number(p_value), _number(level), tuple(found))


def _several(given: Any) -> Sequence[Any]:
    """What may be one or several."""
    return given if isinstance(given, Sequence) and not isinstance(given, str) else (given,)


def _tries(given: Any) -> Sequence[Try]:
    return (given,) if isinstance(given, Try) else given


def _whole(x: Any) -> int:
    if type(x) is not int:
        raise TypeError("a whole number is needed")
    return x


def _number(x: Any) -> float:
    if type(x) not in (int, float):
        raise TypeError("a number is needed")
    return float(x)


def _text(x: Any) -> str:
    if type(x) is not str:
        raise TypeError("a text is needed")
    return x
