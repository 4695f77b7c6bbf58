"""The mind of a robot, for your own simulator or radio."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple, Optional

from . import _native
from .classifier import Classifier
from .training_set import Rule, native_rule


class Message(NamedTuple):
    """A message for the host to carry."""

    key: str
    """Where it belongs: `gestalt/<swarm>/…`, as any Zenoh client would publish it."""
    payload: bytes
    """What travels."""
    to: Optional[int]
    """The neighbour that it is for; None: all robots."""
    is_json: bool
    """Whether the payload is JSON; else `decode` reads it."""


class Mind:
    """The mind of one robot: it votes, decides with others, learns from what it is told, shares and forgets.

    Pure: no clock, no thread, no socket. Times are whole nanoseconds since any fixed moment, such as `time.monotonic_ns()` or a
    simulator's; the same calls at the same times give the same messages, byte for byte.

    Parameters
    ----------
    robot : its number, unique in the swarm.
    seed : where chance comes from. In the field a number drawn at every start; in a simulator the run's, the same for all: with one seed
        this is the robot of that number in `gestalt emulate`.
    boot : grows at every start of this robot, or its votes are taken for old ones.
    vocabulary : the gestures, if you observe probabilities; with a classifier, that one says them.
    swarm : the name that all keys begin with.
    rounds, learning : as in a robot's configuration (`gestalt config` prints it with comments).
    selection, forgetting : rules of your own, in place of those that `learning` names; see `TrainingSet`.
    """

    def __init__(
        self,
        robot: int,
        *,
        seed: int,
        boot: int = 1,
        vocabulary: Optional[Sequence[str]] = None,
        swarm: str = "gestalt",
        rounds: Optional[dict[str, Any]] = None,
        learning: Optional[dict[str, Any]] = None,
        selection: Optional[Rule] = None,
        forgetting: Optional[Rule] = None,
    ) -> None:
        settings = {
            "robot": robot,
            "boot": boot,
            "seed": seed,
            "swarm": swarm,
            "vocabulary": None if vocabulary is None else list(vocabulary),
            "rounds": rounds or {},
            "learning": learning,
        }
        own = [None if rule is None else native_rule(rule) for rule in (selection, forgetting)]
        self._native = _native.Mind(json.dumps(settings), *own)

    def use(self, now: int, classifier: Classifier) -> None:
        """Judges by this classifier from now on: observes features. A mind that learns takes its classifier before all else."""
        self._native.use_model(now, classifier.model)

    def observe(self, now: int, values: Sequence[float], quality: float = 1.0) -> None:
        """A frame showed a hand: its features or, without a classifier, the probability of each gesture, in double precision; `quality` 0 to 1."""
        self._native.observe(now, [float(x) for x in values], quality)

    def received(self, now: int, key: Optional[str], payload: bytes) -> None:
        """A message arrived under that key; None for an envelope by a radio that carries no keys."""
        self._native.received(now, key, payload)

    def instructed(self, now: int, instructor: str, at: int, word: dict[str, Any]) -> None:
        """An instructor says `{"say": "was", "round": {…}, "class": "left"}`; `at` is the same at every robot, and grows."""
        self._native.instructed(now, instructor, at, json.dumps(word))

    def open(self, now: int) -> None:
        """A gesture is being shown: opens a round, unless one is open or was opened just now."""
        self._native.open(now)

    def tick(self, now: int) -> None:
        """Time has passed: owed at `next_wake`, more do no harm."""
        self._native.tick(now)

    def set_blind(self, now: int, blind: bool) -> None:
        """Whether the camera shows nothing at all: a blind robot need not be waited for."""
        self._native.set_blind(now, blind)

    def set_alive(self, now: int, robots: Sequence[int]) -> None:
        """The robots that are alive now."""
        self._native.set_alive(now, list(robots))

    def set_neighbours(self, now: int, robots: Sequence[int]) -> None:
        """The robots that this one can hear directly now, without itself."""
        self._native.set_neighbours(now, list(robots))

    def train(self, now: int) -> bool:
        """Makes the classifier follow what was learned: whether there was anything. Other threads run meanwhile."""
        return self._native.train(now)

    def messages(self) -> Iterator[Message]:
        """Takes what the mind wants said, oldest first."""
        while (message := self._native.next_message()) is not None:
            yield Message(*message)

    @property
    def next_wake(self) -> Optional[int]:
        """When the mind wants its next `tick`, if nothing else comes before."""
        return self._native.next_wake

    @property
    def is_open(self) -> bool:
        """Whether this robot takes part in a round now: it should look."""
        return self._native.is_open

    @property
    def wants_training(self) -> bool:
        """Whether samples came or went that the classifier has not followed."""
        return self._native.wants_training

    @property
    def decision(self) -> Optional[dict[str, Any]]:
        """The decision held for the newest round, with its certificate; None before one."""
        held = self._native.decision()
        return None if held is None else _object(held)

    @property
    def status(self) -> dict[str, Any]:
        """Its round, what it has learned, and what it refused so far, by cause."""
        return _object(self._native.status())


def _object(text: str) -> dict[str, Any]:
    read: dict[str, Any] = json.loads(text)
    return read
