"""Gestalt for Python: a swarm of robots that decides together and learns together.

- `Classifier`: what tells gestures apart, with scikit-learn's manners.
- `TrainingSet`: what a robot learns from, with rules of selection (which samples to share) and of forgetting.
- `fuse`, `Ballot`: from the votes of many to one distribution.
- `decode`, `encode` and their like: every message of the wire, between bytes and dictionaries.
- `Mind`: the robot itself, for your own simulator: messages in, messages out, time is an argument.

Whatever Gestalt refuses raises a `GestaltError`, which is a `ValueError`, and names the cause and the fix. What is no argument of its kind
raises Python's own: `TypeError` for a text in place of a number, `OverflowError` for a whole number beyond its type, as a negative count.
"""

from ._native import (
    FORGETTING_RULES,
    FUSION_RULES,
    SELECTION_RULES,
    DataError,
    DecodeError,
    GestaltError,
    ModelError,
    Sample,
    SettingsError,
    __version__,
)
from .classifier import Classifier, NotFittedError
from .fusion import Ballot, Fusion, fuse
from .mind import Message, Mind
from .training_set import TrainingSet
from .wire import (
    decode,
    decode_frame_header,
    decode_frame_taken,
    encode,
    encode_frame_header,
    encode_frame_taken,
)

__all__ = [
    "Ballot",
    "Classifier",
    "DataError",
    "DecodeError",
    "FORGETTING_RULES",
    "FUSION_RULES",
    "Fusion",
    "GestaltError",
    "Message",
    "Mind",
    "ModelError",
    "NotFittedError",
    "SELECTION_RULES",
    "Sample",
    "SettingsError",
    "TrainingSet",
    "__version__",
    "decode",
    "decode_frame_header",
    "decode_frame_taken",
    "encode",
    "encode_frame_header",
    "encode_frame_taken",
    "fuse",
]
