"""Every message of the wire, between the bytes that travel and dictionaries.

Votes, samples and repair are postcard envelopes; `docs/round.md` walks through them. Decisions, feedback, answers and status are
JSON on the wire: read those with `json.loads`.
"""

from __future__ import annotations

import json
from typing import Any

from . import _native


def decode(payload: bytes) -> dict[str, Any]:
    """An envelope (`robot/<id>/vote`, `…/sample`, `…/repair`): author, stamp, message (kind and body) and signature."""
    return _read(_native.decode_envelope(payload))


def encode(envelope: dict[str, Any]) -> bytes:
    """The bytes of an envelope. What no robot may say is refused, as its readers would."""
    return _native.encode_envelope(_write(envelope))


def decode_frame_header(attachment: bytes) -> dict[str, Any]:
    """What belongs to a picture on `robot/<id>/frame`."""
    return _read(_native.decode_frame_header(attachment))


def encode_frame_header(header: dict[str, Any]) -> bytes:
    """The attachment of a picture on `robot/<id>/frame`."""
    return _native.encode_frame_header(_write(header))


def decode_frame_taken(payload: bytes) -> dict[str, Any]:
    """The acknowledgement on `robot/<id>/taken`."""
    return _read(_native.decode_frame_taken(payload))


def encode_frame_taken(taken: dict[str, Any]) -> bytes:
    """The bytes of an acknowledgement on `robot/<id>/taken`."""
    return _native.encode_frame_taken(_write(taken))


def _read(text: str) -> dict[str, Any]:
    read: dict[str, Any] = json.loads(text)
    return read


def _write(message: dict[str, Any]) -> str:
    try:
        return json.dumps(message, allow_nan=False)
    except (TypeError, ValueError, RecursionError) as error:
        raise _native.DecodeError(f"this is no message: {error}") from error
