"""Where somebody is who steps through a trial, and what is shown there: the same in a window and in a browser."""

from bisect import bisect_right
from dataclasses import dataclass, field
from typing import Literal, final

import numpy as np

from apo_bench.assembly import Assembly, PartFace, placements
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

    @property
    def _assembly(self) -> Assembly:
        return self.story.scene.scenario.assembly

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
        times = [moment.time_s for moment in self.current.moments]
        self.moment = max(self.moment, bisect_right(times, self._played_s) - 1)
        self.playing = self.moment + 1 < len(times)

    def words(self) -> tuple[str, ...]:
        """What is done here, the force, how far goals and the part are from the true goal; at the end, how it ended."""
        moment = self.at
        k = moment.doing.operation
        is_replay = self.current.world is self.story.scene.work and bool(self.current.ending)
        is_last = self.moment == len(self.current.moments) - 1 and bool(self.current.ending)
        return (
            f"{moment.time_s:.2f} s, {operation_words(self._assembly, moment)}",
            *[f"force {moment.doing.force_n:.1f} N"] * is_replay,
            *([] if k is None else [*map(str, self._assembly.operations[k].contacts), *self._offsets(k)]),
            *[self.current.ending] * is_last,
        )

    def _offsets(self, k: int) -> list[str]:
        goals = {name: goals[k] for name, goals in self.story.goals.items()}
        true = goals.pop(AS_TRUE, None)
        if true is None:
            return []
        goals["as it is now"] = part_poses(self.current, self.at)[self._assembly.operations[k].main]
        # T_true^-1 T = Exp(twist): how far off in the part's own frame
        twists = {name: pose.log(pose.inverse(true) @ T) for name, T in goals.items()}
        return [
            f"{name}: {1e3 * np.linalg.norm(t[:3]):.2f} mm, {np.degrees(np.linalg.norm(t[3:])):.2f} degrees off"
            for name, t in twists.items()
        ]

    def _go_operation(self, way: int) -> None:
        """To the first moment of the next operation, or of the one before."""
        doing = [moment.doing.operation for moment in self.current.moments]
        begins = [i for i in range(len(doing)) if i == 0 or doing[i] != doing[i - 1]]
        if way > 0:
            self.go(next((i for i in begins if i > self.moment), len(doing)))
        else:
            self.go(next((i for i in reversed(begins) if i < self.moment), 0))

    def _faces(self) -> tuple[PartFace, ...]:
        k = self.at.doing.operation
        if self.faces == "all":
            solids = self._assembly.solids.items()
            return tuple(PartFace(part, face) for part, solid in solids for face in (*solid.faces, *solid.rounds))
        contacts = () if self.faces == "none" or k is None else self._assembly.operations[k].contacts
        return tuple(dict.fromkeys(of for contact in contacts for of in contact))

    def _ghosts(self) -> tuple[Ghost, ...]:
        """What was moved up to here, where goals put it."""
        k = self.at.doing.operation
        if k is None:
            return ()
        begun = self._assembly.first(k + 1)
        moved = {part for operation in begun.operations for part in operation.moves}
        goals = {name: goals for name, goals in self.story.goals.items() if name in self.goals}
        placed = {name: placements(begun, self.current.start, of[: k + 1])[-1] for name, of in goals.items()}
        return tuple(
            Ghost(name, {p: T for p, T in poses.items() if p in moved}, COLORS[name]) for name, poses in placed.items()
        )
