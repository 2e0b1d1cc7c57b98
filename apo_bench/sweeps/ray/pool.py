"""Workers on a Ray cluster that share the work of a sweep; nodes and workers may go and come.

A node that is lost costs nothing but time: what was under way there runs again elsewhere. A trial that takes its worker
along, twice, is lost; so is one that takes too long.
"""

from __future__ import annotations

import time
from collections import Counter, deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any, final

from apo_bench.errors import InputError
from apo_bench.records.method import is_own
from apo_bench.records.settings import TrialSettings
from apo_bench.sweeps.grid import Unit

Tell = Callable[[tuple[Any, ...]], None]
"""Takes ("row", row, timing), or ("lost", spec, code, number, seconds, place) of a trial that will have no row."""
STARTING_S = 300.0
"""What a worker gets to compile a scene."""
TURN_S = 0.2
LOOK_S = 5.0
"""How often the cluster is asked for its size."""
WAIT_S = 2.0
"""How long a worker waits for news before it answers that there are none."""
AWAY_S = 60.0
"""How long a worker may be out of reach before it is given up; Ray itself gives up a node sooner."""
DEATHS = 2
"""So many workers in a row die of one trial before it is lost: memory may be short for once."""
FALSE_STARTS = 5


@final
@dataclass(eq=False)
class Post:
    """One worker, as the driver sees it."""

    number: int
    actor: Any
    call: Any
    """The answer that is waited for: first where it is, then its news."""
    node: str | None = None
    """None until it has said so."""
    host: str = ""
    unit: list[TrialSettings] = field(default_factory=list)
    """Trials without a row; the first may be under way."""
    heard: int = 0
    since: float | None = None
    """The driver's clock when the trial under way began; None where none is."""
    ready: float | None = None
    """The driver's clock when it was given work, or ended its last trial."""
    away: float | None = None
    """Since when it has been out of reach."""


@final
class Crew:
    """Gives units to workers, one worker per CPU; to be asked for a turn as long as it is busy."""

    def __init__(
        self, work: Sequence[Unit], make: Callable[[int], Any], size: Callable[[], int], limit_s: float
    ) -> None:
        """Args:
        make: Makes the actor of a number.
        size: How many workers there may be now.
        """
        self.posts: list[Post] = []
        self._waiting = deque(list(unit.trials) for unit in work)
        self._make, self._ask_size, self._limit_s = make, size, limit_s
        self._size, self._looked = size(), time.monotonic()
        self._deaths: Counter[TrialSettings] = Counter()
        self._made = self._false_starts = 0
        self._begun = False
        self._clock, self._ticked = 0.0, time.monotonic()

    @property
    def busy(self) -> bool:
        """Whether there are trials without a row."""
        return bool(self._waiting or any(post.unit for post in self.posts))

    def turn(self, tell: Tell) -> None:
        """Hear what there is to hear, and act on it.

        Raises:
            InputError: A worker found that the request cannot be honoured.
            RuntimeError: A trial could not be run at all, or workers end before they have begun.
        """
        import ray

        self._fill()
        calls = [post.call for post in self.posts]
        ray.wait(calls, num_returns=1, timeout=TURN_S)
        answered = set(ray.wait(calls, num_returns=len(calls), timeout=0)[0])
        self._tick()
        for post in list(self.posts):
            if post.call in answered:
                self._hear(post, tell)
            elif self._overdue(post) and _alive(post):
                self._drop(post, "time_limit", tell)

    def stop(self) -> None:
        """Begin no other trial."""
        self._waiting.clear()
        for post in list(self.posts):
            if post.node is None:
                self._discharge(post)
            else:
                post.actor.stop.remote()

    def end(self) -> None:
        """Send everybody home, also who is at work."""
        for post in list(self.posts):
            self._discharge(post)

    def _overdue(self, post: Post) -> bool:
        if post.since is not None:
            return self._clock - post.since > self._limit_s
        return bool(post.unit) and post.ready is not None and self._clock - post.ready > STARTING_S

    def _tick(self) -> None:
        """A clock that stands still while this process does: nobody is late because the driver was asleep."""
        now = time.monotonic()
        self._clock += min(now - self._ticked, 10 * TURN_S)
        self._ticked = now

    def _fill(self) -> None:
        """As many workers as the cluster has room for, and the work has units."""
        if time.monotonic() - self._looked > LOOK_S:
            self._size, self._looked = self._ask_size(), time.monotonic()
        room = self._size - len(self.posts)
        coming = sum(post.node is None for post in self.posts)
        for _ in range(min(room, len(self._waiting) - coming)):
            actor = self._make(self._made)
            self.posts.append(Post(self._made, actor, actor.where.remote()))
            self._made += 1

    def _hear(self, post: Post, tell: Tell) -> None:
        import ray
        from ray.exceptions import ActorUnavailableError, ObjectLostError, RayActorError, RayTaskError

        try:
            answer = ray.get(post.call)
        except (ActorUnavailableError, ObjectLostError):
            self._ask_again(post, tell)
            return
        except RayActorError as error:
            own = _alive(post) and not error.preempted
            self._drop(post, "worker_died" if own else None, tell, str(error))
            return
        except RayTaskError as error:
            raise RuntimeError(f"a worker on '{post.host}' could not answer:\n{error}") from error
        post.away = None
        if post.node is None:
            post.node, post.host, refusal = answer
            if refusal is not None:
                raise InputError(refusal)
            self._next(post)
        else:
            post.heard += len(answer)
            for news in answer:
                self._take(post, news, tell)
        if post in self.posts:
            post.call = post.actor.news.remote(post.heard, WAIT_S)

    def _take(self, post: Post, news: tuple[Any, ...], tell: Tell) -> None:
        kind, *said = news
        if kind == "began":
            post.since, self._false_starts, self._begun = self._clock, 0, True
        elif kind == "row":
            del post.unit[0]
            post.since, post.ready = None, self._clock
            tell(news)
        elif kind == "done":
            post.unit.clear()
            self._next(post)
        elif kind == "refused":
            raise InputError(said[0])
        else:
            raise RuntimeError(f"a trial could not be run:\n{said[0]}")

    def _next(self, post: Post) -> None:
        """Its next unit; if there is none, its CPU is given back."""
        if not self._waiting:
            self._discharge(post)
            return
        post.unit, post.ready = self._waiting.popleft(), self._clock
        post.actor.take.remote(Unit(tuple(post.unit)))

    def _ask_again(self, post: Post, tell: Tell) -> None:
        """It is out of reach: perhaps its node was lost, perhaps only a word."""
        now = time.monotonic()
        post.away = post.away or now
        if now - post.away > AWAY_S:
            self._drop(post, None, tell)
            return
        time.sleep(TURN_S)
        post.call = post.actor.where.remote() if post.node is None else post.actor.news.remote(post.heard, WAIT_S)

    def _drop(self, post: Post, code: str | None, tell: Tell, why: str = "") -> None:
        """A worker is gone, or has to go; its trial under way is lost if that was the trial's own doing."""
        self._discharge(post)
        rest, since = post.unit, post.since
        given_up = since is None and code is not None and self._gives_up(rest, why)
        if given_up:
            tell(("lost", rest.pop(0), code, post.number, 0.0, {"host": post.host, "node": post.node}))
        elif since is not None and code == "worker_died":
            self._deaths[rest[0]] += 1
        if since is not None and (code == "time_limit" or self._deaths[rest[0]] >= DEATHS):
            place = {"host": post.host, "node": post.node}
            tell(("lost", rest.pop(0), code, post.number, self._clock - since, place))
        if rest:
            self._waiting.appendleft(rest)

    def _gives_up(self, rest: Sequence[TrialSettings], why: str) -> bool:
        """Whether workers end too often before a trial began; if that is the corrector's doing, its trial is lost."""
        self._false_starts += 1
        if self._false_starts >= FALSE_STARTS and self._begun and rest and is_own(rest[0].method):
            self._false_starts = 0
            return True
        if self._false_starts >= FALSE_STARTS:
            if "all references to the actor were removed" in why:
                why = "the cluster was started without a token and this machine has one; set RAY_AUTH_MODE=disabled"
            why = " ".join(why.split()) or f"no trial began within {STARTING_S:g} s"
            raise RuntimeError(f"workers on the Ray cluster end before they have begun a trial: {why}")
        return False

    def _discharge(self, post: Post) -> None:
        import ray

        self.posts.remove(post)
        ray.kill(post.actor)


def _alive(post: Post) -> bool:
    """Whether its node is; what happens to a worker whose node was lost is no fault of its trial."""
    import ray

    if post.away is not None:
        return False
    return post.node is None or any(node["NodeID"] == post.node and node["Alive"] for node in ray.nodes())
