"""What a panic in Rust leaves half changed is not used on."""

import json
import os
import unittest
from pathlib import Path

import gestalt_swarm as g
from gestalt_swarm import _native

MS = 1_000_000


def panic():
    """What a panic in Rust raises; what of it a rule raises goes on as a panic in Rust."""

    def broken(samples, rng):
        raise KeyError

    # The class is made when an exception is first looked at.
    samples = g.TrainingSet(1, forgetting=broken)
    samples.keep(0, [1.0], round=1)
    try:
        samples.keep(0, [2.0], round=2)
    except KeyError:
        pass
    return next(kind for kind in BaseException.__subclasses__() if kind.__name__ == "PanicException")


PANIC = panic()


def panics(samples, rng):
    raise PANIC("the sky fell")


class Panics(unittest.TestCase):
    def refuses_all(self, calls):
        for call in calls:
            self.assertRaisesRegex(RuntimeError, "panicked.*half changed.*start another", call)

    def test_a_mind_that_panicked_refuses_all_further_calls(self):
        model = _native.Model.decode(Path(os.environ["GESTALT_MODEL"]).read_bytes())
        settings = {"robot": 1, "boot": 1, "seed": 1, "learning": {"spacing": "0s"}}
        mind = _native.Mind(json.dumps(settings), panics)
        mind.use_model(0, model)
        mind.open(1000 * MS)
        for n in range(8):
            mind.observe((1000 + 600 * n) * MS, [((i * 7 + n) % 11) / 11 for i in range(model.features)], 1.0)
        word = {"say": "was", "round": json.loads(mind.status())["round"], "class": 2}
        with self.assertRaisesRegex(PANIC, "the sky fell"):
            mind.instructed(7000 * MS, "ada", 1, json.dumps(word))
        self.refuses_all(
            [
                lambda: mind.tick(8000 * MS),
                lambda: mind.train(8000 * MS),
                lambda: mind.next_wake,
                lambda: mind.is_open,
                lambda: mind.wants_training,
                mind.next_message,
                mind.decision,
                mind.status,
            ]
        )

    def test_a_set_that_panicked_refuses_all_further_calls(self):
        samples = g.TrainingSet(1, forgetting=panics)
        samples.keep(0, [1.0], round=1)
        with self.assertRaisesRegex(PANIC, "the sky fell"):
            samples.keep(0, [2.0], round=2)
        self.refuses_all(
            [
                lambda: samples.keep(0, [3.0], round=3),
                lambda: samples.share(1),
                lambda: samples.retract(1),
                lambda: samples.samples,
                lambda: len(samples),
            ]
        )


if __name__ == "__main__":
    unittest.main()
