"""Step through a rollout: a cursor at one moment, and what a window or a browser shows there."""

from collections.abc import Hashable, Sequence
from dataclasses import dataclass
from typing import Literal, final

import numpy as np

from apo_bench.assembly import PartFace, compute_placements
from apo_bench.geometry import pose
from apo_bench.simulation.film.film import operation_words
from apo_bench.simulation.film.overlay import Color, FilmSnapshot, Overlay
from apo_bench.simulation.film.track import FilmMoment, Segment, read_part_poses
from apo_bench.trial.rollout import AS_CORRECTED, AS_OBSERVED, AS_TRUE, Rollout

Faces = Literal["none", "this operation", "all"]
FACES: tuple[Faces, ...] = ("none", "this operation", "all")
_COLORS: dict[str, tuple[str, Color]] = {
    AS_OBSERVED: ("orange", (0.95, 0.55, 0.1)),
    AS_CORRECTED: ("green", (0.15, 0.7, 0.3)),
    AS_TRUE: ("violet", (0.55, 0.35, 0.85)),
}
"""Name of target poses -> name of their colour, and RGB in 0..1."""


@final
@dataclass(eq=False)
class Cursor:
    """A position in a rollout, whose segments follow each other; methods move it, `snapshot` describes what to show."""

    rollout: Rollout
    place: int = 0
    """Number of the moment, from 0, counted through all segments."""
    playing: bool = False
    faces: Faces = "this operation"
    shows_goals: bool = False
    _played_s: float = 0.0  # time of playback in the segment, at or after that of the moment shown

    def __post_init__(self) -> None:
        self.places = [(segment, moment) for segment in self.rollout.segments for moment in segment.moments]
        self._assembly = self.rollout.scene.scenario.assembly

    @property
    def segment(self) -> Segment:
        return self.places[self.place][0]

    @property
    def moment(self) -> FilmMoment:
        return self.places[self.place][1]

    @property
    def _is_last(self) -> bool:
        return self.moment is self.segment.moments[-1]

    def snapshot(self) -> FilmSnapshot:
        """Return everything that is shown at this moment."""
        return FilmSnapshot(self.segment, self.moment, self.words(), self._list_faces(), self._list_overlays())

    def press(self, key: str) -> None:
        """Execute a key, one of `WINDOW_KEYS`."""
        way, _, what = key.partition(" ")
        if key == "play":
            self.playing = not self.playing
            if self.playing and self._is_last:  # at its end a segment starts again
                self.go(self.place - len(self.segment.moments) + 1)
        elif key == "faces":
            self.faces = FACES[(FACES.index(self.faces) + 1) % len(FACES)]  # the next choice, cyclically
        elif key == "goals":
            self.shows_goals = not self.shows_goals
        elif what == "operation":
            self._jump_to_group([(id(segment), moment.phase.operation) for segment, moment in self.places], way)
        elif what == "segment":
            self._jump_to_group([id(segment) for segment, _ in self.places], way)
        else:
            self.go(self.place + (1 if way == "next" else -1))

    def go(self, place: int) -> None:
        """Go to the moment with this number, limited to the first and the last."""
        self.place = min(max(place, 0), len(self.places) - 1)
        self._played_s = self.moment.time_s

    def pass_time(self, seconds: float) -> None:
        """Advance by so many seconds of real time if it plays, at most to the end of the segment."""
        self._played_s += seconds
        while self.playing and not self._is_last and self.places[self.place + 1][1].time_s <= self._played_s:
            self.place += 1
        self.playing = self.playing and not self._is_last

    def words(self) -> tuple[str, ...]:
        """Return the lines of text: phase, force, offsets from the true pose; at the end of a segment, the result."""
        moment = self.moment
        ending = self.segment.ending
        k = moment.phase.operation
        words = [f"{moment.time_s:.2f} s, {operation_words(self._assembly, moment)}"]
        if ending and self.segment.world is self.rollout.scene.work:  # only the replay measures a force
            words.append(f"force {moment.phase.force_n:.1f} N")
        if k is not None:
            words += [*map(str, self._assembly.operations[k].contacts), *self._describe_offsets(k)]
        if self.shows_goals:
            words += [f"{_COLORS[name][0]}: {name}" for name in self.rollout.poses]
        if ending and self._is_last:
            words.append(ending)
        return tuple(words)

    def _describe_offsets(self, k: int) -> list[str]:
        """Return the distances of target poses and of the part from the true pose of operation k, in its frame."""
        if AS_TRUE not in self.rollout.poses:
            return []
        placed = {name: poses[k] for name, poses in self.rollout.poses.items()}
        true = placed.pop(AS_TRUE)
        placed["as it is now"] = read_part_poses(self.segment, self.moment)[self._assembly.operations[k].main]
        lines = []
        for name, T in placed.items():
            twist = pose.log(pose.inverse(true) @ T)
            mm = 1e3 * np.linalg.norm(twist[:3])
            lines.append(f"{name}: {mm:.2f} mm, {np.degrees(np.linalg.norm(twist[3:])):.2f} degrees off")
        return lines

    def _jump_to_group(self, groups: Sequence[Hashable], way: str) -> None:
        """Go to the start of the next group, or to the last start before this moment.

        Args:
            groups: The group of each moment; equal neighbours form one group.
            way: `next`, else back.
        """
        begins = [i for i in range(len(groups)) if i == 0 or groups[i] != groups[i - 1]]
        if way == "next":
            self.go(next((i for i in begins if i > self.place), len(groups)))
        else:
            self.go(max((i for i in begins if i < self.place), default=0))

    def _list_faces(self) -> tuple[PartFace, ...]:
        """Return the faces to name: all, or those of the contacts of the current operation, or none."""
        k = self.moment.phase.operation
        if self.faces == "all":
            solids = self._assembly.solids.items()
            return tuple(PartFace(part, face) for part, solid in solids for face in (*solid.faces, *solid.rounds))
        contacts = () if self.faces == "none" or k is None else self._assembly.operations[k].contacts
        return tuple(dict.fromkeys(of for contact in contacts for of in contact))

    def _list_overlays(self) -> tuple[Overlay, ...]:
        """Return the parts that have moved up to now, at the poses where each set of target poses places them."""
        k = self.moment.phase.operation
        if k is None or not self.shows_goals:
            return ()
        begun = self._assembly.first(k + 1)
        moved = {part for operation in begun.operations for part in operation.moves}
        overlays = []
        for name, goals in self.rollout.poses.items():
            poses = compute_placements(begun, self.segment.start, goals[: k + 1])[-1]
            overlays.append(Overlay({part: poses[part] for part in moved}, _COLORS[name][1]))
        return tuple(overlays)


def start_at_end(rollout: Rollout) -> Cursor:
    """Return a cursor at the last moment, which shows the assembly and the outcome, without names of faces."""
    cursor = Cursor(rollout, faces="none")
    cursor.go(len(cursor.places))
    return cursor
