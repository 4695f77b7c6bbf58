"""Among scikit-learn's tools."""

import unittest

import numpy as np
from sklearn.base import clone, is_classifier
from sklearn.datasets import load_digits
from sklearn.model_selection import GridSearchCV, cross_val_score
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler
from sklearn.svm import SVC

from gestalt_swarm import Classifier


class Manners(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.X, cls.y = load_digits(return_X_y=True)
        cls.X, cls.y = cls.X[:600], cls.y[:600]

    def test_it_is_cloned_with_its_parameters_and_without_what_it_learned(self):
        original = Classifier(cost=3.0, components=0.9).fit(self.X, self.y)
        copy = clone(original)
        self.assertEqual(copy.get_params(), original.get_params())
        self.assertFalse(hasattr(copy, "classes_"))
        self.assertTrue(is_classifier(copy))

    def test_cross_validation_finds_it_about_as_good_as_a_calibrated_svm(self):
        own = cross_val_score(Classifier(), self.X, self.y, cv=3).mean()
        other = cross_val_score(make_pipeline(StandardScaler(), SVC(C=10)), self.X, self.y, cv=3).mean()
        self.assertGreater(own, other - 0.02, f"{own:.3f} against {other:.3f}")

    def test_a_grid_is_searched(self):
        grid = GridSearchCV(Classifier(components=20), {"cost": [0.01, 10.0], "gamma": [0.5, 1.0]}, cv=3)
        grid.fit(self.X, self.y)
        self.assertEqual(grid.best_params_["cost"], 10.0)
        self.assertEqual(grid.predict_proba(self.X[:5]).shape, (5, 10))
        np.testing.assert_array_equal(grid.classes_, np.arange(10))

    def test_it_stands_at_the_end_of_a_pipeline(self):
        pipeline = make_pipeline(StandardScaler(), Classifier(components=20)).fit(self.X, self.y)
        self.assertGreater(pipeline.score(self.X, self.y), 0.95)


if __name__ == "__main__":
    unittest.main()
