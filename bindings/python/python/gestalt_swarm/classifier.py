"""The classifier of a robot, with scikit-learn's manners and without depending on it."""

from __future__ import annotations

import contextlib
import importlib
import inspect
import os
import tempfile
import threading
from pathlib import Path
from typing import TYPE_CHECKING, Any

from . import _native
from ._native import DataError, GestaltError, SettingsError

if TYPE_CHECKING:
    from collections.abc import Iterator

    import numpy as np
    import numpy.typing as npt

    Floats = npt.NDArray[np.float64]
    Singles = npt.NDArray[np.float32]


class NotFittedError(GestaltError, AttributeError):
    """Asked before it learned anything: call `fit` or `partial_fit`, or `load` a model."""


class Classifier:
    """Scaling, principal components, one-vs-one support vector machines with a Gaussian kernel, calibrated probabilities.

    What robots learn with on the spot: `partial_fit` brings the machines up to date instead of training them again.
    Fits into `sklearn.base.clone`, `cross_val_score`, `GridSearchCV` and pipelines.

    Parameters
    ----------
    cost : C, what a sample on the wrong side of the margin costs; 0.001 to 10,000.
    gamma : γ of the kernel, in units of 1 / (total variance of the reduced samples); 0.0001 to 10,000.
    components : principal components to keep; a number below 1 is the part of the variance to keep.
    scaling : "per_component" (z-score) or "common" (one factor for all, for histograms).
    folds : parts of the cross-validation that probabilities are fitted on; 2 to 20.
    staleness : the part of a pair's samples that may come before its probabilities are fitted again; 0 to 0.25.
    seed : of the search for principal components.
    feature_set : names the features in a model file; perception refuses a model of other features than its own.

    Attributes
    ----------
    classes_ : the gestures, in the order of `predict_proba`'s columns; at most 64.
    n_features_in_ : features of a sample.
    """

    _estimator_type = "classifier"

    classes_: npt.NDArray[Any]
    n_features_in_: int
    _model: _native.Model
    _learner: _native.Learner | None

    def __init__(
        self,
        *,
        cost: float = 10.0,
        gamma: float = 1.0,
        components: float = 60,
        scaling: str = "per_component",
        folds: int = 5,
        staleness: float = 0.1,
        seed: int = 0,
        feature_set: str = "python",
    ) -> None:
        self.cost = cost
        self.gamma = gamma
        self.components = components
        self.scaling = scaling
        self.folds = folds
        self.staleness = staleness
        self.seed = seed
        self.feature_set = feature_set

    def fit(self, X: npt.ArrayLike, y: npt.ArrayLike) -> Classifier:
        """Learns from these samples alone: `X` of shape (samples, features), `y` the gesture of each."""
        import numpy as np

        rows, labels = _samples(X, y)
        with self._alone():
            self._begin(rows, labels, np.unique(labels))
        return self

    def partial_fit(
        self, X: npt.ArrayLike, y: npt.ArrayLike, classes: npt.ArrayLike | None = None
    ) -> Classifier:
        """Learns from these samples as well. The first call fits the feature space on its samples and needs all `classes`,
        if they are not all among `y`."""
        import numpy as np

        rows, labels = _samples(X, y)
        with self._alone():
            if not hasattr(self, "_model"):
                self._begin(rows, labels, np.unique(labels if classes is None else np.asarray(classes)))
                return self
            if classes is not None and not np.array_equal(np.unique(np.asarray(classes)), np.unique(self.classes_)):
                raise DataError("classes differ from those of the first call")
            if self._learner is None:
                self._learner = _native.Learner.on(self._model, **self._options())
            _check_width(rows, self.n_features_in_)
            self._learner.insert(rows.tobytes(), _places(labels, self.classes_))
            self._model = self._learner.learn()
        return self

    def _begin(self, rows: Singles, labels: npt.NDArray[Any], classes: npt.NDArray[Any]) -> None:
        learner = _native.Learner(
            [str(label) for label in classes],
            rows.tobytes(),
            rows.shape[1],
            scaling=self.scaling,
            components=float(self.components),
            seed=self.seed,
            feature_set=self.feature_set,
            **self._options(),
        )
        learner.insert(rows.tobytes(), _places(labels, classes))
        model = learner.learn()
        # All of it at once: what is refused, or interrupted, leaves what was learned before as it was.
        self.__dict__.update(classes_=classes, n_features_in_=rows.shape[1], _learner=learner, _model=model)

    @contextlib.contextmanager
    def _alone(self) -> Iterator[None]:
        """One thread learns at a time: what two learn at once would be neither's."""
        lock = self.__dict__.setdefault("_lock", threading.Lock())
        if not lock.acquire(blocking=False):
            raise RuntimeError("another thread teaches this Classifier: teach it in one, or each its own")
        try:
            yield
        finally:
            lock.release()

    def _options(self) -> dict[str, Any]:
        return {"cost": self.cost, "gamma": self.gamma, "folds": self.folds, "staleness": self.staleness}

    def predict_proba(self, X: npt.ArrayLike) -> Floats:
        """The probability of each gesture: shape (samples, classes), each row sums to 1."""
        return self._judged(X)[0]

    def predict(self, X: npt.ArrayLike) -> npt.NDArray[Any]:
        """The likeliest gesture of each sample."""
        judged, classes = self._judged(X)
        gestures: npt.NDArray[Any] = classes[judged.argmax(axis=1)]
        return gestures

    def _judged(self, X: npt.ArrayLike) -> tuple[Floats, npt.NDArray[Any]]:
        import numpy as np

        model, classes, rows = self._known(X)
        judged = np.frombuffer(model.probabilities(rows.tobytes()), dtype=np.float64)
        return judged.reshape(len(rows), len(classes)).copy(), classes

    def score(self, X: npt.ArrayLike, y: npt.ArrayLike) -> float:
        """The part of the samples that are told right."""
        import numpy as np

        return float(np.mean(self.predict(X) == np.asarray(y)))

    def transform(self, X: npt.ArrayLike) -> Singles:
        """Coordinates in the feature space: what samples of a `TrainingSet` hold."""
        import numpy as np

        model, _, rows = self._known(X)
        coordinates = np.frombuffer(model.coordinates(rows.tobytes()), dtype=np.float32)
        return coordinates.reshape(len(rows), model.components).copy()

    @property
    def model(self) -> _native.Model:
        """What it has learned."""
        model: _native.Model | None = getattr(self, "_model", None)
        if model is None:
            raise NotFittedError("this Classifier has learned nothing yet: call fit or partial_fit, or load a model")
        return model

    def save(self, path: str | os.PathLike[str]) -> None:
        """Writes a model file; an older one survives a failure."""
        path = Path(path)
        data = self.model.encode()
        handle, temporary = tempfile.mkstemp(dir=path.parent, prefix=path.name)
        try:
            with os.fdopen(handle, "wb") as file:
                file.write(data)
                file.flush()
                os.fsync(file.fileno())
            os.chmod(temporary, 0o644)
            os.replace(temporary, path)
        except BaseException:
            os.unlink(temporary)
            raise

    @classmethod
    def load(cls, path: str | os.PathLike[str], **parameters: Any) -> Classifier:
        """Reads a model file, of `save` or of `gestalt train`, whose gestures are texts; `parameters` are for what it
        learns on."""
        import numpy as np

        self = cls(**parameters)
        self._model = _native.Model.decode(Path(path).read_bytes())
        self._learner = None
        self.classes_, self.n_features_in_ = np.array(self._model.labels), self._model.features
        return self

    def get_params(self, deep: bool = True) -> dict[str, Any]:
        """The parameters by name."""
        return {name: getattr(self, name) for name in _PARAMETERS}

    def set_params(self, **params: Any) -> Classifier:
        """Sets parameters by name; they count from the next `fit` on."""
        for name, value in params.items():
            if name not in _PARAMETERS:
                raise SettingsError(f"{name!r} is no parameter: take one of {', '.join(_PARAMETERS)}")
            setattr(self, name, value)
        return self

    def __repr__(self) -> str:
        own = inspect.signature(type(self)).parameters
        changed = {name: value for name, value in self.get_params().items() if value != own[name].default}
        return f"Classifier({', '.join(f'{name}={value!r}' for name, value in changed.items())})"

    def __getstate__(self) -> dict[str, Any]:
        # The learner's samples stay behind: what is loaded learns on from the support vectors.
        state = {name: value for name, value in self.__dict__.items() if name not in ("_learner", "_lock", "_model")}
        if hasattr(self, "_model"):
            state["_model"] = self._model.encode()
        return state

    def __setstate__(self, state: dict[str, Any]) -> None:
        model = state.pop("_model", None)
        self.__dict__.update(state)
        if model is not None:
            self._model, self._learner = _native.Model.decode(model), None

    def __sklearn_is_fitted__(self) -> bool:
        return hasattr(self, "_model")

    def __sklearn_tags__(self) -> Any:
        # Asked by scikit-learn alone, which is there then.
        utils: Any = importlib.import_module("sklearn.utils")
        return utils.Tags(
            estimator_type="classifier",
            target_tags=utils.TargetTags(required=True),
            transformer_tags=None,
            classifier_tags=utils.ClassifierTags(),
            regressor_tags=None,
        )

    def _known(self, X: npt.ArrayLike) -> tuple[_native.Model, npt.NDArray[Any], Singles]:
        """What was learned, all of one moment: another thread may learn anew meanwhile."""
        self.model  # says so if there is none
        known = dict(self.__dict__)
        rows = _matrix(X)
        _check_width(rows, known["n_features_in_"])
        return known["_model"], known["classes_"], rows


_PARAMETERS = tuple(inspect.signature(Classifier).parameters)


def _matrix(X: npt.ArrayLike) -> Singles:
    import numpy as np

    try:
        with np.errstate(over="ignore"):  # what is too large becomes infinite, and is refused by name
            rows = np.ascontiguousarray(X, dtype=np.float32)
    except (TypeError, ValueError) as error:
        raise DataError(f"X is no matrix of numbers: {error}") from error
    if rows.ndim != 2 or rows.shape[1] == 0:
        raise DataError(f"X has the shape {rows.shape}: (samples, features) is expected")
    return rows


def _samples(X: npt.ArrayLike, y: npt.ArrayLike) -> tuple[Singles, npt.NDArray[Any]]:
    import numpy as np

    rows, labels = _matrix(X), np.asarray(y)
    if labels.ndim != 1 or len(labels) != len(rows):
        raise DataError(f"y has the shape {labels.shape}: one gesture for each of {len(rows)} samples is expected")
    return rows, labels


def _check_width(rows: Singles, features: int) -> None:
    if rows.shape[1] != features:
        raise DataError(f"X has {rows.shape[1]} features, it learned from {features}")


def _places(labels: npt.NDArray[Any], classes: npt.NDArray[Any]) -> bytes:
    """The place of each label among the classes, which of a model that was loaded are in its own order."""
    import numpy as np

    known = np.isin(labels, classes)
    if not known.all():
        raise DataError(f"{labels[~known][0]!r} is not among the classes: name all in the first call")
    ascending = np.argsort(classes)
    places: npt.NDArray[Any] = ascending[np.searchsorted(classes, labels, sorter=ascending)]
    return places.astype(np.uint8).tobytes()
