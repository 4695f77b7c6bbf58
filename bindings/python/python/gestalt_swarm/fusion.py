"""From the evidence of many robots to one distribution over the gestures."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple, Optional

from . import _native


class Fusion(NamedTuple):
    """What a set of votes amounts to."""

    probabilities: list[float]
    """The fused probability of each class."""
    top: int
    """The likeliest class; of equals the smaller."""
    margin: float
    """By how much it leads, in units of the most that one robot can add to that lead."""


def fuse(rule: str, votes: Sequence[Sequence[float]], clip: float = 6.0) -> Optional[Fusion]:
    """Fuses one row of centred log-evidence (nats) per robot, clipped to ±`clip`, by one of `FUSION_RULES`.

    None when they say nothing: there is no vote, or all abstain.
    """
    fused = _native.fuse(rule, [list(vote) for vote in votes], clip)
    return None if fused is None else Fusion(*fused)


class Ballot:
    """The latest vote of each robot in one round. Casting commutes, and repeats harmlessly."""

    def __init__(self, labels: Sequence[str]) -> None:
        self._native = _native.Ballot(list(labels))

    def cast(
        self, robot: int, evidence: Sequence[float], *, stamp: tuple[int, int] = (1, 1), looks: float = 1.0
    ) -> str:
        """Puts a vote in, if its stamp (boot, sequence) is the latest of that robot: "counted", "known" or "full".

        No evidence is a null vote: the robot takes part and has seen nothing.
        """
        return self._native.cast(robot, stamp, list(evidence), looks)

    def fuse(self, rule: str = "log_pool", clip: float = 6.0) -> Optional[Fusion]:
        """All evidence as one distribution; None when there is none."""
        fused = self._native.fuse(rule, clip)
        return None if fused is None else Fusion(*fused)

    def __len__(self) -> int:
        return len(self._native)
