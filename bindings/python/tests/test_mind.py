"""Minds in a simulator of one's own."""

import json
import os
import random
import unittest
from pathlib import Path

import gestalt_swarm as g

MS = 1_000_000


class Radio:
    """Robots that all hear each other, but for what is lost; virtual time."""

    def __init__(self, robots, loss, seed, vocabulary=("left", "right", "stop")):
        self.minds = {i: g.Mind(i, seed=seed, vocabulary=list(vocabulary)) for i in range(1, robots + 1)}
        for i, mind in self.minds.items():
            mind.set_alive(0, list(self.minds))
            mind.set_neighbours(0, [j for j in self.minds if j != i])
        self.loss, self.chance, self.air, self.said = loss, random.Random(seed), [], []

    def show(self, shown, start):
        """All see the same gesture alike, ten times a second."""
        seen = [0.6 if k == shown else 0.2 for k in range(3)]
        return self.run(1, start, lambda _, ms: seen if ms % 100 == 0 else None)

    def run(self, opener, start, sees):
        """A round; `sees` says what a robot sees at a time, or that it does not look then."""
        self.minds[opener].open(start * MS)
        for ms in range(start, start + 6000, 10):
            now, air, self.air = ms * MS, self.air, []
            for author, message in air:
                for i, mind in self.minds.items():
                    if i != author and message.to in (None, i) and self.chance.random() >= self.loss:
                        mind.received(now, message.key, message.payload)
            for i, mind in self.minds.items():
                if mind.is_open and (seen := sees(i, ms)):
                    mind.observe(now, seen)
                if mind.next_wake is not None and mind.next_wake <= now:
                    mind.tick(now)
                self.air += [(i, message) for message in mind.messages()]
            self.said += self.air
        return [mind.decision and mind.decision["label"] for mind in self.minds.values()]


class Minds(unittest.TestCase):
    def test_twenty_minds_that_lose_a_third_of_all_messages_agree(self):
        radio = Radio(20, 0.3, 1)
        self.assertEqual(radio.show(2, 1000), ["stop"] * 20)
        announced = [m for _, m in radio.said if m.key == "gestalt/gestalt/decision"]
        self.assertTrue(announced and announced[0].is_json)
        self.assertEqual(json.loads(announced[0].payload)["label"], "stop")
        votes = [g.decode(m.payload) for _, m in radio.said if m.key.endswith("/vote")]
        self.assertTrue(votes and all(vote["message"]["kind"] == "vote" for vote in votes))

    def test_twenty_minds_decide_what_the_emulated_swarm_of_that_seed_decided(self):
        # Each robot sees what its twin in `gestalt emulate` saw, at the same pace; the air and what it loses are of this file.
        decided = []
        for run in json.loads(Path(os.environ["GESTALT_EXPECTED"]).read_text())["emulated"]:
            radio, step = Radio(20, 0.3, run["seed"], run["labels"]), round(run["period"] * 1000)
            for n, showing in enumerate(run["showings"]):
                start, looks = 1000 + 7000 * n, [iter(of_robot) for of_robot in showing["looks"]]
                held = radio.run(
                    showing["opener"], start, lambda i, ms: next(looks[i - 1], None) if (ms - start) % step == 0 else None
                )
                theirs = [None if k is None else run["labels"][k] for k in showing["held"]]
                self.assertEqual(held, theirs, f"seed {run['seed']}, showing {n}")
            decided.append([showing["held"] for showing in run["showings"]])
        # What they saw decides, not chance: the other seed showed other gestures.
        self.assertNotEqual(decided[0], decided[1])

    def test_the_same_seed_gives_the_same_messages_byte_for_byte(self):
        runs = []
        for seed in (3, 3, 4):
            radio = Radio(4, 0.2, seed)
            radio.show(0, 1000)
            runs.append(radio.said)
        self.assertEqual(runs[0], runs[1])
        self.assertNotEqual(runs[0], runs[2])

    def test_what_a_mind_refuses_raises_by_its_cause(self):
        mind = g.Mind(1, seed=1, vocabulary=["left", "right"])
        mind.open(0)
        for values in ([0.5], [0.5, float("nan")], [0.9, 0.9]):
            with self.assertRaises(g.DataError):
                mind.observe(1, values)
        for key, payload in ((None, b""), ("gestalt/gestalt/decision", b"{}"), ("gestalt/other/decision", b"{}")):
            with self.assertRaises(g.DecodeError):
                mind.received(1, key, payload)
        for settings in (dict(rounds={"alpha": 0.9}), dict(rounds={"alhpa": 0.1}), dict(swarm="a/b"), dict(vocabulary=["one"])):
            with self.assertRaises(g.SettingsError, msg=str(settings)):
                g.Mind(1, seed=1, **settings)
        with self.assertRaises(OverflowError):
            mind.tick(-1)
        self.assertEqual(mind.status["refused"], {})


if __name__ == "__main__":
    unittest.main()
