#!/usr/bin/env python3
"""Opens a round in a sealed swarm, or says what was shown, with the files of `gestalt trust enrol --client`.

    pip install eclipse-zenoh cryptography
    python3 examples/instruct.py keys/client-desk --connect tls/127.0.0.1:7447 '{"say": "open"}'

The word is JSON; its signature travels beside it (docs/trust.md).
"""
import argparse
import hashlib
import json
import pathlib
import struct
import time

from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey


def attachment(key: Ed25519PrivateKey, roster: dict, name: str, word: bytes, count: int) -> bytes:
    """What travels beside a word: who signed it, as which of its words, and the signature."""
    swarm = hashlib.sha256(b"gestalt-swarm-1" + bytes.fromhex(roster["authority"]) + roster["swarm"].encode()).digest()
    head = b"\x01" + struct.pack("<Q", count)
    return head + key.sign(b"gestalt-word-1\0" + swarm + head + bytes([len(name)]) + name.encode() + word)


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("folder", type=pathlib.Path, help="folder of the client, client-NAME")
    parser.add_argument("word", help='such as {"say": "open"}')
    parser.add_argument("--connect", default="tls/127.0.0.1:7447", help="endpoint of a robot")
    args = parser.parse_args()
    try:
        said = json.loads(args.word)
    except ValueError as error:
        parser.error(f"the word is no JSON: {error}; write it as '{{\"say\": \"open\"}}'")
    name = args.folder.resolve().name.removeprefix("client-")
    roster = json.loads((args.folder / "roster.json").read_text())
    secret = bytes.fromhex((args.folder / f"client-{name}.key").read_text().strip())
    key = Ed25519PrivateKey.from_private_bytes(secret)
    # Grows with every word, as long as the clock is right: seconds in the upper half, as in Zenoh's timestamps.
    count = int(time.time() * 2**32)
    word = args.word.encode()

    import zenoh

    config = zenoh.Config.from_file(str(args.folder / "zenoh.json5"))
    config.insert_json5("connect/endpoints", json.dumps([args.connect]))
    try:
        session = zenoh.open(config)
    except zenoh.ZError as error:
        raise SystemExit(f"no robot answers at {args.connect}: {error}") from None
    with session:
        key_expr = f"gestalt/{roster['swarm']}/instructor/{name}"

        def on_answer(sample) -> None:
            # Another word of the same client may be answered meanwhile. To open a round is not answered: the decision is.
            if json.loads(sample.payload.to_string())["to"] == said:
                print(sample.payload.to_string(), flush=True)

        answers = session.declare_subscriber(f"{key_expr}/answer", on_answer)
        session.put(f"{key_expr}/word", word, attachment=attachment(key, roster, name, word, count),
                    encoding=zenoh.Encoding.APPLICATION_JSON)
        time.sleep(3)
        answers.undeclare()


if __name__ == "__main__":
    main()
