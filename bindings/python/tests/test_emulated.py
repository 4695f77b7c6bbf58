"""Minds in Python against those of `gestalt emulate`, on the same seed."""

import json
import os
import pathlib
import unittest

from emulated import Apart, follow

FOLDER = pathlib.Path(os.environ["GESTALT_EMULATED"])


def trace(name):
    return (FOLDER / f"{name}.jsonl").read_text().splitlines()


class Emulated(unittest.TestCase):
    def test_twenty_minds_that_lose_three_messages_of_ten_hold_in_each_round_what_the_emulated_ones_hold(self):
        for name in ("twenty-0", "twenty-7"):
            lines, decided = trace(name), 0
            robots = {line["robot"] for line in map(json.loads, lines) if line["what"] == "start"}
            self.assertEqual(robots, set(range(1, 21)))
            rounds = list(self.watch(lines))
            self.assertEqual(len(rounds), 6)
            for decisions, _ in rounds:
                decided += all(decision and decision["class"] is not None for decision in decisions)
            self.assertGreaterEqual(decided, 4, "rounds in which all twenty hold a gesture")
            messages = sum(json.loads(line)["what"] in ("broadcast", "tell", "announce") for line in lines)
            self.assertEqual(rounds[-1][1], messages)
            self.assertGreater(messages, 1000)

    def watch(self, lines):
        for _, swarm in follow(lines):
            yield [mind.decision for mind in swarm.minds.values()], swarm.messages

    def test_so_do_minds_whose_links_fail_that_freeze_and_that_start_again(self):
        self.assertEqual(len(list(follow(trace("churn-0")))), 8)

    def test_another_seed_makes_other_minds(self):
        with self.assertRaises(Apart):
            list(follow(trace("twenty-0"), seed=1))

    def test_one_message_that_is_lost_here_alone_is_noticed(self):
        lines = trace("twenty-0")
        read = [json.loads(line) for line in lines]
        # What made a robot decide.
        held = next(at for at, line in enumerate(read) if line["what"] == "hold" and read[at - 1]["what"] == "hear")
        with self.assertRaises(Apart):
            list(follow(lines[: held - 1] + lines[held:]))

    def test_a_frame_that_is_seen_otherwise_is_noticed(self):
        read = [json.loads(line) for line in trace("twenty-0")]
        seen = next(line for line in read if line["what"] == "see")
        seen["probabilities"] = seen["probabilities"][::-1]
        with self.assertRaises(Apart):
            list(follow(json.dumps(line) for line in read))


if __name__ == "__main__":
    unittest.main()
