#!/usr/bin/env python3
"""Opens a round in a sealed swarm, or says what was shown, with the files of `gestalt trust enrol --client`.

    python3 -m venv venv && . venv/bin/activate && pip install eclipse-zenoh cryptography      # needs python3-venv
    python3 examples/instruct.py keys/client-desk --connect tls/127.0.0.1:7447 '{"say": "open"}'

A robot listens there if it is started so: `gestalt peer --id 1 --swarm demo --keys keys --source rendered -l tls/127.0.0.1:7447`.
The word is JSON; its signature travels beside it (docs/trust.md).
"""
import argparse
import hashlib
import json
import pathlib
import struct
import sys
import threading
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
    # Grows with every word: seconds in the upper half, as in Zenoh's timestamps. Robots heed no word whose count is not above the last one's, so the
    # last is kept beside the key, where `gestalt teach` keeps it, for a clock that is set back.
    counted = args.folder / f"client-{name}.words"
    try:
        last = int(counted.read_text())
    except (OSError, ValueError):
        last = 0
    count = max(int(time.time() * 2**32), last + 1)
    try:
        counted.write_text(f"{count}\n")
    except OSError as error:
        print(f"the count of this word is not kept: {error}", file=sys.stderr)
    word = args.word.encode()

    import zenoh

    config = zenoh.Config.from_file(str(args.folder / "zenoh.json5"))
    config.insert_json5("connect/endpoints", json.dumps([args.connect]))
    try:
        session = zenoh.open(config)
    except zenoh.ZError as error:
        raise SystemExit(f"no robot answers at {args.connect}: {error}") from None
    with session:
        swarm = f"gestalt/{roster['swarm']}"
        key_expr = f"{swarm}/instructor/{name}"
        opens, spoken, heard, refused = said == {"say": "open"}, threading.Event(), threading.Event(), threading.Event()
        before = set()

        def on_answer(sample) -> None:
            # Another word of the same client may be answered meanwhile.
            if json.loads(sample.payload.to_string())["to"] == said:
                print(sample.payload.to_string(), flush=True)
                if opens:
                    refused.set()
                heard.set()

        def on_decision(sample) -> None:
            # To open a round is answered by the decision, or by why there will be none. Rounds that were decided before it was said are others'.
            decided = json.dumps(json.loads(sample.payload.to_string())["round"], sort_keys=True)
            if not spoken.is_set():
                before.add(decided)
            elif decided not in before:
                print(sample.payload.to_string(), flush=True)
                heard.set()

        subscribers = [session.declare_subscriber(f"{key_expr}/answer", on_answer)]
        if opens:
            subscribers.append(session.declare_subscriber(f"{swarm}/decision", on_decision))
            time.sleep(1)
        spoken.set()
        session.put(f"{key_expr}/word", word, attachment=attachment(key, roster, name, word, count),
                    encoding=zenoh.Encoding.APPLICATION_JSON)
        patience = 15 if opens else 10
        answered = heard.wait(patience)
        if opens:
            # A decision of others' round may come before the answer.
            refused.wait(0.5)
        for subscriber in subscribers:
            subscriber.undeclare()
    if refused.is_set():
        raise SystemExit(f"no round was opened for '{name}', as its answer says: gestalt trust enrol --client {name} --role open keys, where the authority's key is, gives it the role")
    if not answered:
        raise SystemExit(f"no {'decision' if opens else 'answer'} within {patience} s: the word is none that robots know (docs/clients.md), "
                         f"or the roster has no '{name}' with this key any more, or this key was last used by a clock that is ahead of this one's; gestalt doctor --keys {args.folder} -e {args.connect} says what is wrong")


if __name__ == "__main__":
    main()
