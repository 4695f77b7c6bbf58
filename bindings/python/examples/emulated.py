"""Minds in Python are told what those of `gestalt emulate` were: do they say and hold the same?

    gestalt emulate configs/emulation/twenty.json5 --seeds 1 --trace trace.jsonl
    python3 bindings/python/examples/emulated.py trace.jsonl

The trace says what each robot sees, and which message reaches whom when; what is lost reaches nobody. The messages themselves are those of
the minds here: no byte that one of them hears, and nothing that one holds, is the emulator's. Robots that lie or learn cannot be followed.
"""

from __future__ import annotations

import json
import sys
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from typing import Any

from gestalt_swarm import Message, Mind, decode


class Apart(Exception):
    """Minds in Python and those of the emulator say or hold different things."""


class Swarm:
    """The minds of the robots of a trace, in Python."""

    def __init__(self, run: dict[str, Any], seed: int | None = None) -> None:
        scenario = run["scenario"]
        if scenario["learning"] or any(group.get("lies") for group in scenario["robots"]):
            raise ValueError("robots of this trace lie or learn: what moves them is not in it")
        self.seed = run["seed"] if seed is None else seed
        self.rounds, self.classes = scenario["mind"], [str(k) for k in range(scenario["classes"])]
        sees = [group.get("view") is not None for group in scenario["robots"] for _ in range(group["count"])]
        self.sees = dict(enumerate(sees, 1))
        self.minds: dict[int, Mind] = {}
        # What each robot of the emulator holds, all that was said here, and what the emulator has yet to say as well.
        self.held: dict[int, dict[str, Any]] = {}
        self.said: dict[tuple[int, int, int], Message] = {}
        self.unsaid: dict[int, deque[tuple[tuple[int, int, int], Message]]] = {}
        self.messages = 0

    def follow(self, line: dict[str, Any]) -> None:
        """Lets happen here what happened there, and compares what comes of it."""
        what, now, robot = line["what"], line["at_ns"], line.get("robot")
        if what == "start":
            seen = self.classes if self.sees[robot] else None
            self.minds[robot] = Mind(robot, seed=self.seed, boot=line["boot"], vocabulary=seen, rounds=self.rounds)
            self.unsaid[robot] = deque()
            self.tell(robot, lambda mind: mind.tick(now))
        elif what == "fault" and "kill" in line["event"]:
            self.minds.pop(line["event"]["kill"], None)
            self.held.pop(line["event"]["kill"], None)
        elif what in ("broadcast", "tell", "announce", "ask"):
            self.compare_said(line)
        elif what == "hold":
            self.held[robot] = line["decision"]
        elif what == "opened":
            self.held.pop(robot, None)
        elif what == "shown":
            self.tell(line["opener"], lambda mind: mind.open(now))
        elif what == "alive":
            self.tell(robot, lambda mind: mind.set_alive(now, line["robots"]))
        elif what == "neighbours":
            self.tell(robot, lambda mind: mind.set_neighbours(now, line["robots"]))
        elif what == "see":
            self.tell(robot, lambda mind: mind.observe(now, line["probabilities"], line["quality"]))
        elif what == "tick":
            self.tell(robot, lambda mind: mind.tick(now))
        elif what == "hear":
            message = self.said.get(stamp(line["from"], line))
            if message is None:
                raise Apart(f"robot {robot} hears what robot {line['from']} never said: {line}")
            self.tell(robot, lambda mind: mind.received(now, message.key, message.payload))

    def tell(self, robot: int, what: Callable[[Mind], None]) -> None:
        mind = self.minds[robot]
        what(mind)
        for message in mind.messages():
            envelope = json.loads(message.payload) if message.is_json else decode(message.payload)
            key = stamp(robot, envelope)
            self.said[key] = message
            self.unsaid[robot].append((key, message))

    def compare_said(self, line: dict[str, Any]) -> None:
        """What a robot of the emulator says is the next that the one here said."""
        robot = line["robot"]
        if not self.unsaid[robot]:
            raise Apart(f"robot {robot} says nothing here, and there: {line}")
        key, message = self.unsaid[robot].popleft()
        here = (key, message.to, line.get("bytes") and len(message.payload))
        # A question carries its stamp within.
        there = (stamp(robot, line.get("question", line)), line.get("to"), line.get("bytes"))
        if here != there:
            raise Apart(f"robot {robot} says {here} here, {there} there")
        self.messages += 1

    def compare_held(self) -> None:
        """All has been said, and each robot holds what the one of the emulator does: the same gesture, confidence and voters."""
        for robot, mind in self.minds.items():
            here, there = brief(mind.decision), self.held.get(robot)
            if here != there:
                raise Apart(f"robot {robot} holds {here} here, {there} there")
            if self.unsaid[robot]:
                raise Apart(f"robot {robot} says {self.unsaid[robot][0]} here, nothing there")


def stamp(robot: int, said: dict[str, Any]) -> tuple[int, int, int]:
    return (robot, said["stamp"]["boot"], said["stamp"]["sequence"])


def brief(decision: dict[str, Any] | None) -> dict[str, Any] | None:
    """A decision as the trace has it."""
    if decision is None:
        return None
    voters = [vote["robot"] for vote in decision["certificate"]["votes"]]
    return {key: decision[key] for key in ("round", "class", "confidence", "author")} | {"voters": voters}


def follow(lines: Iterable[str], seed: int | None = None) -> Iterator[tuple[Any, Swarm]]:
    """Follows a trace; after each showing gives what was shown, and the minds. Another seed than the trace's makes other robots of them."""
    read = (json.loads(line) for line in lines)
    swarm, shown = Swarm(next(read), seed), None
    for line in read:
        if line["what"] == "shown":
            if shown is not None:
                swarm.compare_held()
                yield shown, swarm
            shown = line["class"]
        swarm.follow(line)
    swarm.compare_held()
    yield shown, swarm


def main() -> None:
    if len(sys.argv) != 2:
        raise SystemExit(__doc__)
    with open(sys.argv[1], encoding="utf-8") as trace:
        for shown, swarm in follow(trace):
            held = [mind.decision for mind in swarm.minds.values()]
            right = sum(decision is not None and decision["class"] == shown for decision in held)
            print(f"gesture {shown}: {right} of {len(held)} minds hold it; {swarm.messages} messages so far, all as in the trace")


if __name__ == "__main__":
    main()
