#!/usr/bin/env python3
"""Prints each decision of a running swarm, from any robot of it: one that listens there, as `gestalt peer -c configs/footbot.json5 -l tcp/127.0.0.1:7447` does.

    python3 -m venv venv && . venv/bin/activate && pip install eclipse-zenoh      # needs python3-venv
    python3 examples/subscribe.py --connect tcp/127.0.0.1:7447 --swarm gestalt
    python3 examples/subscribe.py --connect tls/192.168.1.5:7447 --config keys/client-desk/zenoh.json5    # a sealed swarm

One message per decision; `round` tells the rare repeat (a spokesrobot that died while it spoke) from news.
"""
import argparse
import json
import sys
import time

import zenoh


def in_words(decision: dict) -> str:
    # Null where nothing was decided; the label also where whoever says it has another vocabulary.
    what = "no decision" if decision["class"] is None else decision["label"] or f"class {decision['class']}"
    certificate = decision["certificate"]
    voted = f"{len(certificate['votes'])} robots, {certificate['elapsed_ms']} ms"
    return f"round {decision['round']['counter']}: {what} ({decision['confidence']:.3f}, {voted})"


def main() -> None:
    arguments = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    arguments.add_argument("--connect", "-e", default="tcp/127.0.0.1:7447", help="a robot's endpoint")
    arguments.add_argument("--config", help="Zenoh configuration, as `gestalt trust enrol --client` writes it")
    arguments.add_argument("--swarm", default="gestalt", help="the swarm's name")
    arguments.add_argument("--count", type=int, default=0, help="stop after so many decisions; 0: never")
    arguments.add_argument("--json", action="store_true", help="print the messages as they came")
    given = arguments.parse_args()

    config = zenoh.Config.from_file(given.config) if given.config else zenoh.Config()
    config.insert_json5("mode", '"client"')
    config.insert_json5("connect/endpoints", json.dumps([given.connect]))

    try:
        session = zenoh.open(config)
    except zenoh.ZError as error:
        raise SystemExit(f"no robot answers at {given.connect}: {error}") from None
    with session:
        decisions = session.declare_subscriber(f"gestalt/{given.swarm}/decision")
        seen = 0
        while given.count == 0 or seen < given.count:
            # A short wait, so that Ctrl-C is heard between decisions.
            sample = decisions.try_recv()
            if sample is None:
                time.sleep(0.02)
                continue
            text = sample.payload.to_bytes().decode(errors="replace")
            seen += 1
            if given.json:
                print(text, flush=True)
                continue
            try:
                print(in_words(json.loads(text)), flush=True)
            except (ValueError, TypeError, KeyError, OverflowError, RecursionError) as error:
                # In an open swarm anybody may say anything there.
                print(f"what is no decision: {error!r}", file=sys.stderr, flush=True)


if __name__ == "__main__":
    try:
        main()
    except KeyboardInterrupt:
        pass
