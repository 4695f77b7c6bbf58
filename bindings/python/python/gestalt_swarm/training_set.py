"""The samples a robot learns from: its own, those it shared, those of others, and never more than it can hold."""

from __future__ import annotations

import random
from collections.abc import Callable, Sequence
from typing import Optional, Union

from . import _native
from ._native import Sample
from .classifier import Classifier

Rule = Callable[[list[Sample], random.Random], Optional[int]]
"""A rule of one's own: of these samples, and a generator whose seed comes from the set's, the key of the one it picks."""


class TrainingSet:
    """The bounded set of samples of one robot.

    A sample of one's own is personal until it is shared, once; what others shared is external, and taken in at most once. When there
    are more than `capacity`, the forgetting rule says which one goes.

    Parameters
    ----------
    capacity : the most samples held.
    selection : which personal sample to share next: one of `SELECTION_RULES`, or a callable.
    forgetting : which sample goes when there are too many: one of `FORGETTING_RULES`, or a callable.
    seed : where chance comes from; the same seed and calls give the same choices as in a robot.
    robot : whose set it is.

    A callable gets all samples and a `random.Random`, and gives the key of one of them; None, or any other, ends the sharing, or
    lets the oldest go. What it raises is raised by the call that asked it.

    While `keep`, `share` and `receive` work, other threads run. A set is one thread's at a time: another that calls it meanwhile gets
    a `RuntimeError`.
    """

    def __init__(
        self,
        capacity: int = 1000,
        *,
        selection: Union[str, Rule] = "k_center",
        forgetting: Union[str, Rule] = "redundancy",
        seed: int = 0,
        robot: int = 1,
    ) -> None:
        self._robot = robot
        self._native = _native.TrainingSet(robot, capacity, native_rule(selection), native_rule(forgetting), seed)

    def keep(self, class_: int, vector: Sequence[float], round: Union[int, str]) -> list[Sample]:
        """Takes an own sample in; gives those that were forgotten for it. A round is a number, or a name like "5@2-3f9a01c7"."""
        return self._native.keep(class_, self._round(round), [float(x) for x in vector])

    def share(self, count: int = 1, classifier: Optional[Classifier] = None) -> list[Sample]:
        """Selects up to `count` personal samples, which become shared, in the order of their choice. The rule "margin" asks the
        classifier how sure it is."""
        return self._native.share(count, None if classifier is None else classifier.model)

    def receive(
        self, id: tuple[int, int, int], class_: int, vector: Sequence[float], round: Union[int, str]
    ) -> bool:
        """Takes in a sample that another robot shared, by its `id` (author, life, number): whether it was new."""
        return self._native.receive(id, class_, self._round(round), [float(x) for x in vector])

    def relabel(self, round: Union[int, str], class_: int) -> int:
        """Gives all samples of a round another class: how many had another."""
        return self._native.relabel(self._round(round), class_)

    def retract(self, round: Union[int, str]) -> list[Sample]:
        """Removes all samples of a round, for good; gives these."""
        return self._native.retract(self._round(round))

    @property
    def samples(self) -> list[Sample]:
        """All samples, by key."""
        return self._native.samples()

    @property
    def capacity(self) -> int:
        """The most samples that are held."""
        return self._native.capacity

    def __len__(self) -> int:
        return len(self._native)

    def _round(self, round: Union[int, str]) -> str:
        return round if isinstance(round, str) else f"{int(round)}@{self._robot}-00000000"


def native_rule(rule: Union[str, Rule]) -> Union[str, Callable[[list[Sample], int], Optional[int]]]:
    """A rule as the native part asks it."""
    if isinstance(rule, str) or not callable(rule):
        return rule
    chosen: Rule = rule

    def seeded(samples: list[Sample], seed: int) -> Optional[int]:
        return chosen(samples, random.Random(seed))

    return seeded
