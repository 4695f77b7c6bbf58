"""What is computed is what Rust computes, bit for bit; needs nothing but Python."""

import array
import json
import os
import struct
import threading
import unittest
from pathlib import Path

import gestalt_swarm
from gestalt_swarm import _native


def expected():
    return json.loads(Path(os.environ["GESTALT_EXPECTED"]).read_text())


def model():
    return _native.Model.decode(Path(os.environ["GESTALT_MODEL"]).read_bytes())


def grid(samples, width, shift=0):
    """Rows that differ, without numpy."""
    return array.array("f", [((i * 7919 + shift) % 1009) / 101.0 for i in range(samples * width)]).tobytes()


PARAMETERS = dict(cost=10.0, gamma=1.0, folds=5, staleness=0.1)


def learner(samples=40, width=4, **changes):
    parameters = dict(scaling="per_component", components=3.0, seed=1, feature_set="toy", **PARAMETERS)
    parameters.update(changes)
    return _native.Learner(["left", "right"], grid(samples, width), width, **parameters)


class Probabilities(unittest.TestCase):
    def test_probabilities_equal_those_of_rust_bit_for_bit(self):
        hands = model()
        for judged in expected()["judged"]:
            rows = struct.pack(f"{len(judged['features'])}I", *judged["features"])
            bits = struct.unpack(f"{len(judged['probabilities'])}Q", hands.probabilities(rows))
            self.assertEqual(list(bits), judged["probabilities"])

    def test_a_model_file_is_written_as_it_was_read(self):
        data = Path(os.environ["GESTALT_MODEL"]).read_bytes()
        self.assertEqual(_native.Model.decode(data).encode(), data)

    def test_bytes_that_are_no_model_raise(self):
        data = bytearray(Path(os.environ["GESTALT_MODEL"]).read_bytes())
        for broken in (b"", b"GESTALT\n", bytes(data[:-1]), bytes(data) + b"x"):
            with self.assertRaises(gestalt_swarm.ModelError):
                _native.Model.decode(broken)
        data[-1] ^= 1
        with self.assertRaisesRegex(gestalt_swarm.ModelError, "checksum"):
            _native.Model.decode(bytes(data))

    def test_what_is_no_argument_of_its_kind_raises_pythons_own(self):
        ballot = gestalt_swarm.Ballot(["left", "right"])
        mind = gestalt_swarm.Mind(1, seed=1, vocabulary=["left", "right"])
        for call in (lambda: ballot.cast(-1, [0.5, -0.5]), lambda: mind.observe(-1, [0.5, 0.5])):
            self.assertRaises(OverflowError, call)
        self.assertRaises(TypeError, lambda: ballot.cast("one", [0.5, -0.5]))

    def test_wrong_shapes_and_numbers_raise_and_never_abort(self):
        hands = model()
        for rows in (b"abc", grid(1, hands.features - 1), struct.pack("f", float("nan")) * hands.features):
            with self.assertRaises(gestalt_swarm.DataError):
                hands.probabilities(rows)
        for changes in (
            dict(cost=0.0),
            dict(cost=float("nan")),
            dict(folds=1),
            dict(scaling="none"),
            dict(components=0.0),
            dict(components=float("inf")),
            dict(components=2.5),
            dict(feature_set=""),
        ):
            with self.assertRaises(gestalt_swarm.SettingsError, msg=str(changes)):
                learner(**changes)
        with self.assertRaises(gestalt_swarm.DataError):
            _native.Learner(
                ["a", "b"], bytes(64), 4, scaling="common", components=2.0, seed=0, feature_set="x", **PARAMETERS
            )

    def test_a_refused_batch_leaves_no_sample_behind(self):
        machines = learner()
        machines.insert(grid(4, 4), bytes([0, 1, 0, 1]))
        with self.assertRaises(gestalt_swarm.DataError):
            machines.insert(grid(4, 4), bytes([0, 1, 9, 1]))
        with self.assertRaises(gestalt_swarm.DataError):
            machines.insert(grid(4, 4), bytes([0, 1]))
        self.assertEqual(len(machines), 4)
        self.assertEqual(machines.learn().learned, [2, 2])


class Threads(unittest.TestCase):
    def test_while_one_thread_trains_another_runs(self):
        machines = learner(1500, 4)
        machines.insert(grid(1500, 4, 5), bytes(i % 2 for i in range(1500)))
        done = threading.Event()

        def train():
            machines.learn()
            done.set()

        thread = threading.Thread(target=train)
        thread.start()
        steps = 0
        while not done.is_set():
            steps += 1
        thread.join()
        # Without the release this thread would have come to run once or twice.
        self.assertGreater(steps, 1000)


if __name__ == "__main__":
    unittest.main()
