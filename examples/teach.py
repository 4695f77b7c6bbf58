#!/usr/bin/env python3
"""Teaches a running swarm from the keyboard: shows its decision, and what the swarm asks; asks what the gesture really was, prints the answer.

    pip install eclipse-zenoh
    python3 examples/teach.py --connect tcp/127.0.0.1:7447 --swarm gestalt

Teaching is a put of JSON on `gestalt/<swarm>/instructor/<name>/feedback`; answers come on `…/<name>/answer`.
"""
import argparse
import json
import time

import zenoh


def wait_for(subscriber, patience: float):
    """The next message as JSON, or None when the time is up."""
    end = time.monotonic() + patience
    while time.monotonic() < end:
        sample = subscriber.try_recv()
        if sample is not None:
            return json.loads(sample.payload.to_string())
        time.sleep(0.02)
    return None


def main() -> None:
    arguments = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    arguments.add_argument("--connect", "-e", default="tcp/127.0.0.1:7447", help="a robot's endpoint")
    arguments.add_argument("--swarm", default="gestalt", help="the swarm's name")
    arguments.add_argument("--name", default="python", help="the instructor's name")
    arguments.add_argument("--gestures", nargs="*", help="say these of the next rounds, instead of asking")
    given = arguments.parse_args()

    config = zenoh.Config()
    config.insert_json5("mode", '"client"')
    config.insert_json5("timestamping/enabled", "true")  # answers name the word that they answer by its time
    config.insert_json5("connect/endpoints", json.dumps([given.connect]))
    prefix = f"gestalt/{given.swarm}"
    feedback = f"{prefix}/instructor/{given.name}/feedback"

    try:
        session = zenoh.open(config)
    except zenoh.ZError as error:
        raise SystemExit(f"no robot answers at {given.connect}: {error}") from None
    with session:
        decisions = session.declare_subscriber(f"{prefix}/decision")
        answers = session.declare_subscriber(f"{prefix}/instructor/{given.name}/answer")
        questions = session.declare_subscriber(f"{prefix}/question")
        told = iter(given.gestures) if given.gestures is not None else None
        while True:
            said = next(told, "") if told is not None else None
            if said == "":
                return
            # Half a second after a round began, a request to open is taken for an echo of the one before.
            time.sleep(1)
            session.put(feedback, json.dumps({"say": "open"}))
            decision = wait_for(decisions, 15)
            if decision is None:
                print("no decision: is a robot alive?")
                return
            print(f"round {decision['round']['counter']}: {decision['label'] or 'no decision'}", flush=True)
            if told is None:
                # The swarm asks a second after a round that is worth it; any word on the round answers.
                question = wait_for(questions, 2.5)
                if question is not None and question["round"] == decision["round"]:
                    print(f"  the swarm asks: {question['ask']['kind']} {' or '.join(question['labels'])}", flush=True)
            gesture = said or input("it was (empty to end): ")
            if not gesture:
                return
            # Gestures are named by label; a number in JSON would be a class.
            session.put(feedback, json.dumps({"say": "was", "round": decision["round"], "class": gesture}))
            answer = wait_for(answers, 10)
            print("no answer" if answer is None else f"  {answer['outcome']}, {answer['samples']} samples of it", flush=True)


if __name__ == "__main__":
    try:
        main()
    except (KeyboardInterrupt, EOFError):
        pass
