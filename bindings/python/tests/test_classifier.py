"""The classifier, with numpy."""

import os
import pickle
import tempfile
import threading
import unittest
from pathlib import Path

import numpy as np

import gestalt_swarm as g


def hands(samples=240, seed=1):
    """Three gestures in eight dimensions, that overlap a little."""
    rng = np.random.default_rng(seed)
    y = rng.integers(0, 3, samples)
    X = rng.normal(size=(samples, 8)) + 2.5 * np.eye(3, 8)[y]
    return X, np.array(["fist", "palm", "two"])[y]


class Learning(unittest.TestCase):
    def test_it_tells_what_it_learned(self):
        X, y = hands()
        classifier = g.Classifier(components=6).fit(X[:160], y[:160])
        self.assertGreater(classifier.score(X[160:], y[160:]), 0.85)
        p = classifier.predict_proba(X)
        self.assertEqual((p.shape, p.dtype), ((240, 3), np.float64))
        np.testing.assert_allclose(p.sum(axis=1), 1.0)
        np.testing.assert_array_equal(classifier.predict(X), classifier.classes_[p.argmax(axis=1)])
        self.assertEqual(classifier.transform(X).shape, (240, 6))

    def test_the_same_samples_and_seed_give_the_same_model_byte_for_byte(self):
        X, y = hands()
        models = [g.Classifier().fit(X, y).model.encode() for _ in range(2)]
        self.assertEqual(models[0], models[1])

    def test_it_learns_on(self):
        X, y = hands()
        classifier = g.Classifier().partial_fit(X[:60], y[:60], classes=["fist", "palm", "two", "unseen"])
        before = classifier.score(X[160:], y[160:])
        for start in range(60, 160, 20):
            classifier.partial_fit(X[start : start + 20], y[start : start + 20])
        self.assertGreaterEqual(classifier.score(X[160:], y[160:]), before - 0.02)
        self.assertEqual(sum(classifier.model.learned), 160)
        # What was never shown is as likely as "unknown": in most of what was taught less likely than one of four.
        self.assertLess(np.median(classifier.predict_proba(X)[:, 3]), 0.2)
        with self.assertRaisesRegex(g.DataError, "not among the classes"):
            classifier.partial_fit(X[:2], ["fist", "thumb"])
        with self.assertRaisesRegex(g.DataError, "features"):
            classifier.partial_fit(X[:2, :5], y[:2])
        self.assertEqual(sum(classifier.model.learned), 160)

    def test_what_is_refused_leaves_what_was_learned(self):
        X, y = hands()
        classifier = g.Classifier(components=4).fit(X, y)
        before = classifier.predict_proba(X)
        numbers = np.unique(y, return_inverse=True)[1].astype(float)
        for bad in (np.where(numbers == 2, np.nan, numbers), np.zeros(len(y))):
            with self.assertRaises(g.GestaltError):
                classifier.fit(X, bad)
            np.testing.assert_array_equal(classifier.predict_proba(X), before)
            np.testing.assert_array_equal(classifier.classes_, ["fist", "palm", "two"])

    def test_it_answers_by_what_it_knew_while_another_thread_teaches_it(self):
        X, y = hands()
        classifier = g.Classifier(components=4).fit(X, y)
        before = classifier.predict(X[:5])
        many, labels = hands(4000)
        other = np.char.add("new ", labels)
        thread = threading.Thread(target=classifier.fit, args=(many, other))
        thread.start()
        while not classifier._lock.locked() and thread.is_alive():
            pass
        refused = answered = 0
        while thread.is_alive():
            gestures = classifier.predict(X[:5])
            answered += 1
            self.assertTrue((gestures == before).all() or np.char.startswith(gestures, "new ").all(), gestures)
            try:
                classifier.partial_fit(X[:2], y[:2])
            except RuntimeError as error:
                self.assertIn("another thread", str(error))
                refused += 1
            except g.DataError:
                # It had just learned.
                pass
        thread.join()
        self.assertGreater(min(refused, answered), 0)
        self.assertTrue(np.char.startswith(classifier.predict(X), "new ").all())

    def test_a_file_and_a_pickle_judge_alike_and_learn_on(self):
        X, y = hands()
        classifier = g.Classifier(components=4).fit(X, y)
        expected = classifier.predict_proba(X)
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "hands.gestalt"
            classifier.save(path)
            classifier.save(path)
            self.assertEqual(os.listdir(folder), ["hands.gestalt"])
            copies = [g.Classifier.load(path), pickle.loads(pickle.dumps(classifier))]
            with self.assertRaises(FileNotFoundError):
                classifier.save(Path(folder) / "missing" / "hands.gestalt")
        for copy in copies:
            np.testing.assert_array_equal(copy.predict_proba(X), expected)
            copy.partial_fit(X[:20], y[:20])
            self.assertGreater(copy.score(X, y), 0.85)

    def test_a_model_whose_gestures_are_in_another_order_learns_on_rightly(self):
        X, y = hands()
        first = g.Classifier().fit(X, np.where(y == "fist", "z-fist", y))
        order = {label: k for k, label in enumerate(["two", "z-fist", "palm"])}
        options = dict(cost=10.0, gamma=1.0, folds=5, staleness=0.1)
        rows = X.astype(np.float32).tobytes()
        native = g._native.Learner(
            list(order), rows, 8, scaling="common", components=8.0, seed=0, feature_set="toy", **options
        )
        labels = np.where(y == "fist", "z-fist", y)
        native.insert(rows, bytes(order[label] for label in labels))
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "toy.gestalt"
            path.write_bytes(native.learn().encode())
            second = g.Classifier.load(path)
        self.assertEqual(list(second.classes_), list(order))
        second.partial_fit(X[:60], labels[:60])
        self.assertGreater(second.score(X, labels), 0.9)
        self.assertEqual(sorted(first.classes_), sorted(second.classes_))

    def test_the_model_of_the_repository_is_read(self):
        classifier = g.Classifier.load(os.environ["GESTALT_MODEL"])
        self.assertEqual(classifier.predict_proba(np.zeros((2, classifier.n_features_in_))).shape[0], 2)


class Refusing(unittest.TestCase):
    def test_wrong_shapes_and_nan_raise_and_never_abort(self):
        X, y = hands()
        broken = X.copy()
        broken[3, 5] = np.nan
        for wrong, labels in (
            (broken, y),
            (X * 1e300, y),
            (X[0], y),
            (X[:, :0], y),
            (X[:-1], y),
            (X, y[:, None]),
            ([["a", "b"]], ["c"]),
            ([[1.0], [1.0, 2.0]], [0, 1]),
            (np.zeros_like(X), y),
            (X[:1], y[:1]),
            (X, ["one"] * len(y)),
            (X, np.arange(len(y))),
        ):
            with self.assertRaises(g.GestaltError):
                g.Classifier().fit(wrong, labels)
        classifier = g.Classifier().fit(X, y)
        for wrong in (broken, X[:, :5], X[0], X * 1e300):
            with self.assertRaises(g.DataError):
                classifier.predict_proba(wrong)
        with self.assertRaisesRegex(g.DataError, "feature 5 of sample 3"):
            classifier.predict(broken)

    def test_one_that_learned_nothing_says_so(self):
        X, _ = hands()
        for ask in (g.Classifier().predict, g.Classifier().predict_proba, g.Classifier().transform):
            with self.assertRaises(g.NotFittedError):
                ask(X)

    def test_a_refused_fit_leaves_what_was_learned(self):
        X, y = hands()
        classifier = g.Classifier().fit(X, y)
        expected = classifier.predict_proba(X)
        with self.assertRaises(g.GestaltError):
            classifier.set_params(cost=-1.0).fit(X[:, :5], y)
        np.testing.assert_array_equal(classifier.predict_proba(X), expected)

    def test_parameters_have_names(self):
        classifier = g.Classifier(cost=3.0)
        self.assertEqual(repr(classifier), "Classifier(cost=3.0)")
        with self.assertRaises(g.SettingsError):
            classifier.set_params(C=1.0)


class Minds(unittest.TestCase):
    def test_a_mind_with_rules_in_python_learns_from_what_it_is_told(self):
        X, y = hands()
        asked = []

        def newest(samples, rng):
            asked.append(len(samples))
            return max((s.key for s in samples if s.part == "personal"), default=None)

        learning = {"spacing": "0s", "share_samples": 1}
        mind = g.Mind(1, seed=1, learning=learning, selection=newest)
        mind.use(0, g.Classifier().fit(X, y))
        mind.open(1_000_000_000)
        for n in range(5):
            mind.observe(1_000_000_000 + n * 600_000_000, X[n])
        word = {"say": "was", "round": mind.status["round"], "class": "palm"}
        mind.instructed(5_000_000_000, "ada", 1, word)
        self.assertTrue(asked and mind.wants_training and mind.train(6_000_000_000))
        shared = [g.decode(m.payload) for m in mind.messages() if m.key.endswith("/sample")]
        self.assertEqual(len(shared[0]["message"]["body"]["samples"]), 1)


if __name__ == "__main__":
    unittest.main()
