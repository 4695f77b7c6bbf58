"""Training sets, and rules of one's own."""

import json
import os
import threading
import time
import unittest
from pathlib import Path

import gestalt_swarm as g


class Sets(unittest.TestCase):
    def test_what_rules_choose_in_a_thousand_random_sets_is_what_rust_chooses(self):
        sets = json.loads(Path(os.environ["GESTALT_EXPECTED"]).read_text())["sets"]
        self.assertEqual(len(sets), 1000)
        shared = forgotten = 0
        for n, case in enumerate(sets):
            rules = dict(selection=case["selection"], forgetting=case["forgetting"])
            samples = g.TrainingSet(case["capacity"], seed=case["seed"], **rules)
            for i, step in enumerate(case["steps"], 1):
                gone = [sample.key for sample in samples.keep(step["class"], step["vector"], round=i)]
                self.assertEqual(gone, step["forgotten"], f"set {n}, step {i}: {rules}")
                chosen = [sample.key for sample in samples.share(step["count"])]
                self.assertEqual(chosen, step["shared"], f"set {n}, step {i}: {rules}")
                shared, forgotten = shared + len(chosen), forgotten + len(gone)
        self.assertGreater(min(shared, forgotten), 2000)

    def test_own_rules_choose(self):
        newest = lambda samples, rng: max(s.key for s in samples if s.part == "personal")
        oldest = lambda samples, rng: min(s.key for s in samples)
        samples = g.TrainingSet(3, selection=newest, forgetting=oldest)
        for n in range(5):
            samples.keep(0, [float(n)], round=n + 1)
        self.assertEqual([s.key for s in samples.samples], [3, 4, 5])
        self.assertEqual([s.key for s in samples.share(1)], [5])
        self.assertEqual(samples.samples[-1].id, (1, 0, 1))

    def test_what_an_own_rule_raises_is_raised_and_the_bound_stands(self):
        def broken(samples, rng):
            raise KeyError("my rule")

        samples = g.TrainingSet(2, selection=broken, forgetting=broken)
        samples.keep(0, [1.0], round=1)
        samples.keep(0, [2.0], round=2)
        with self.assertRaisesRegex(KeyError, "my rule"):
            samples.keep(0, [3.0], round=3)
        self.assertEqual(len(samples), 2)
        with self.assertRaisesRegex(KeyError, "my rule"):
            samples.share(1)
        self.assertEqual([s.part for s in samples.samples], ["personal"] * 2)

    def test_an_own_rule_that_gives_nonsense_breaks_nothing(self):
        for nonsense in (None, 10**9):
            samples = g.TrainingSet(2, selection=lambda s, r: nonsense, forgetting=lambda s, r: nonsense)
            for n in range(4):
                samples.keep(0, [float(n)], round=n + 1)
            self.assertEqual([s.key for s in samples.samples], [3, 4])
            self.assertEqual(samples.share(2), [])
        samples = g.TrainingSet(1, forgetting=lambda s, r: "a")
        samples.keep(0, [1.0], round=1)
        with self.assertRaises(TypeError):
            samples.keep(0, [1.0], round=2)

    def test_a_rule_that_meddles_with_its_set_is_told_so(self):
        samples = g.TrainingSet(1, forgetting=lambda s, r: len(samples))
        samples.keep(0, [1.0], round=1)
        with self.assertRaises(RuntimeError):
            samples.keep(0, [2.0], round=2)
        self.assertEqual(len(samples), 1)

    def test_the_seed_of_a_set_is_that_of_its_own_rules(self):
        def drawn(seed):
            seen = []
            draw = lambda samples, rng: seen.append(rng.random())
            samples = g.TrainingSet(2, forgetting=draw, seed=seed)
            for n in range(6):
                samples.keep(0, [float(n)], round=n + 1)
            return seen

        self.assertEqual(drawn(1), drawn(1))
        self.assertNotEqual(drawn(1), drawn(2))

    def test_samples_are_taken_in_once_relabelled_and_retracted(self):
        samples = g.TrainingSet()
        self.assertTrue(samples.receive((2, 9, 1), 0, [1.0], round="5@2-3f9a01c7"))
        self.assertFalse(samples.receive((2, 9, 1), 0, [1.0], round="5@2-3f9a01c7"))
        self.assertEqual(samples.relabel("5@2-3f9a01c7", 4), 1)
        self.assertEqual([(s.part, s.class_) for s in samples.samples], [("external", 4)])
        self.assertEqual(len(samples.retract("5@2-3f9a01c7")), 1)
        self.assertFalse(samples.receive((2, 9, 1), 0, [1.0], round="5@2-3f9a01c7"))

    def test_what_is_no_sample_raises(self):
        samples = g.TrainingSet()
        samples.keep(0, [1.0, 2.0], round=1)
        for arguments in ((0, [1.0], 2), (0, [1.0, float("nan")], 2), (64, [1.0, 2.0], 2), (0, [1.0, 2.0], "five")):
            with self.assertRaises(g.DataError, msg=str(arguments)):
                samples.keep(arguments[0], arguments[1], round=arguments[2])
        for arguments in (dict(capacity=0), dict(selection="best"), dict(forgetting=3)):
            with self.assertRaises(g.SettingsError):
                g.TrainingSet(**arguments)
        with self.assertRaises(g.DataError):
            samples.keep(256, [1.0, 2.0], round=2)

    def test_a_first_sample_that_is_refused_does_not_say_how_many_coordinates_there_are(self):
        samples = g.TrainingSet()
        with self.assertRaisesRegex(g.DataError, "count from 1"):
            samples.receive((2, 9, 0), 0, [1.0, 2.0], round=1)
        samples.keep(0, [1.0], round=1)
        with self.assertRaisesRegex(g.DataError, "the set has 1"):
            samples.receive((2, 9, 1), 0, [1.0, 2.0], round=1)
        self.assertTrue(samples.receive((2, 9, 1), 0, [1.0], round=1))

    def test_while_one_thread_works_on_a_set_another_runs(self):
        many = 6000
        samples = g.TrainingSet(many, selection="k_center", forgetting="fifo")
        for n in range(many):
            samples.keep(0, [float(n * k % 1009) for k in range(1, 17)], round=n + 1)

        thread = threading.Thread(target=samples.share, args=(many,))
        thread.start()
        moments = set()
        while thread.is_alive():
            moments.add(time.monotonic_ns() // 10_000_000)
        # Without the release this thread would run before and after it alone: in three moments at most, of some forty.
        self.assertGreater(len(moments), 6)


if __name__ == "__main__":
    unittest.main()
