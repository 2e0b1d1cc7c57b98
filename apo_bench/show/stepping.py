"""Where somebody is who steps through a trial, and what is shown there: the same in a window and in a browser."""

from dataclasses import dataclass, field
from typing import Literal, final

import numpy as np

from apo_bench.assembly import PartFace, Poses, placements
from apo_bench.geometry import pose
from apo_bench.simulation.film.film import operation_words
from apo_bench.simulation.film.still import Chapter, Color, FilmMoment, Ghost, Still, part_poses
from apo_bench.trial.story import AS_CORRECTED, AS_SEEN, AS_TRUE, Story

Faces = Literal["none", "this operation", "all"]
FACES: tuple[Faces, ...] = ("none", "this operation", "all")
COLORS: dict[str, Color] = {AS_SEEN: (0.95, 0.55, 0.1), AS_CORRECTED: (0.15, 0.7, 0.3), AS_TRUE: (0.55, 0.35, 0.85)}
COLOR_NAMES = {AS_SEEN: "orange", AS_CORRECTED: "green", AS_TRUE: "violet"}
"""Of goals."""


@final
@dataclass(eq=False)
class Cursor:
    """One place in a story; methods move it, `still` says what is there."""

    story: Story
    chapter: int = 0
    moment: int = 0
    playing: bool = False
    faces: Faces = "this operation"
    goals: set[str] = field(default_factory=set)
    """Names of goals that are drawn."""
    _played_s: float = 0.0

    @property
    def current(self) -> Chapter:
        return self.story.chapters[self.chapter]

    @property
    def at(self) -> FilmMoment:
        return self.current.moments[self.moment]

    def still(self) -> Still:
        """What is to be seen here."""
        return Still(self.current, self.at, self.words(), self._faces(), self._ghosts())

    def press(self, key: str) -> None:
        """Do what a key means, one of `KEYS` of the window."""
        way = -1 if key.startswith("previous") else 1
        if key == "play":
            if not self.playing and self.moment == len(self.current.moments) - 1:
                self.go(0)
            self.playing = not self.playing
        elif key.endswith("operation"):
            self._go_operation(way)
        elif key.endswith("chapter"):
            self.turn_to(self.chapter + way)
        elif key == "faces":
            self.faces = FACES[(FACES.index(self.faces) + 1) % len(FACES)]
        elif key == "goals":
            self.goals = set() if self.goals else set(self.story.goals)
        else:
            self.go(self.moment + way)

    def go(self, moment: int) -> None:
        """To a moment of this chapter, by its number; beyond an end to the end."""
        self.moment = min(max(moment, 0), len(self.current.moments) - 1)
        self._played_s = self.at.time_s

    def turn_to(self, chapter: int) -> None:
        """To the beginning of another chapter, by its number."""
        self.chapter = min(max(chapter, 0), len(self.story.chapters) - 1)
        self.playing = False
        self.go(0)

    def pass_time(self, seconds: float) -> None:
        """Go on in real time, if that is asked for; it stops at the end of the chapter."""
        if not self.playing:
            return
        self._played_s += seconds
        moments = self.current.moments
        k = self.moment
        while k + 1 < len(moments) and moments[k + 1].time_s <= self._played_s:
            k += 1
        self.moment = k
        self.playing = k + 1 < len(moments)

    def words(self) -> tuple[str, ...]:
        """What is done here, the force, how far goals and the part are from the true goal; at the end, how it ended."""
        moment = self.at
        assembly = self.story.scene.scenario.assembly
        words = [f"{moment.time_s:.2f} s, {operation_words(assembly, moment)}"]
        if self.current.world is self.story.scene.work and self.current.ending:
            words.append(f"force {moment.doing.force_n:.1f} N")
        if moment.doing.operation is not None:
            words += map(str, assembly.operations[moment.doing.operation].contacts)
            words += self._offsets(moment.doing.operation)
        if self.moment == len(self.current.moments) - 1 and self.current.ending:
            words.append(self.current.ending)
        return tuple(words)

    def _offsets(self, k: int) -> list[str]:
        true = self.story.goals.get(AS_TRUE)
        if true is None:
            return []
        part = self.story.scene.scenario.assembly.operations[k].main
        named = {name: goals[k] for name, goals in self.story.goals.items() if name != AS_TRUE}
        named["as it is now"] = part_poses(self.current, self.at)[part]
        offsets = []
        for name, T in named.items():
            # T_true^-1 T = Exp(twist): how far off in the part's own frame
            twist = pose.log(pose.inverse(true[k]) @ T)
            mm = 1e3 * np.linalg.norm(twist[:3])
            deg = np.degrees(np.linalg.norm(twist[3:]))
            offsets.append(f"{name}: {mm:.2f} mm, {deg:.2f} degrees off")
        return offsets

    def _go_operation(self, way: int) -> None:
        """To the first moment of the next operation, or of the one before."""
        begins = [0] + [
            i
            for i, (a, b) in enumerate(zip(self.current.moments, self.current.moments[1:], strict=False), start=1)
            if a.doing.operation != b.doing.operation
        ]
        beyond = [i for i in begins if (i > self.moment if way > 0 else i < self.moment)]
        self.go((beyond[0] if way > 0 else beyond[-1]) if beyond else (len(self.current.moments) if way > 0 else 0))

    def _faces(self) -> tuple[PartFace, ...]:
        assembly = self.story.scene.scenario.assembly
        k = self.at.doing.operation
        if self.faces == "all":
            return tuple(PartFace(s, f) for s, solid in assembly.solids.items() for f in (*solid.faces, *solid.rounds))
        if self.faces == "none" or k is None:
            return ()
        return tuple(dict.fromkeys(of for contact in assembly.operations[k].contacts for of in contact))

    def _ghosts(self) -> tuple[Ghost, ...]:
        """What was moved up to here, where goals put it."""
        k = self.at.doing.operation
        assembly = self.story.scene.scenario.assembly
        if k is None:
            return ()
        moved = {part for operation in assembly.operations[: k + 1] for part in operation.moves}

        def placed(name: str) -> Poses:
            goals = self.story.goals[name]
            poses = placements(assembly.first(k + 1), self.current.start, goals[: k + 1])[-1]
            return {part: T for part, T in poses.items() if part in moved}

        return tuple(Ghost(name, placed(name), COLORS[name]) for name in self.story.goals if name in self.goals)
