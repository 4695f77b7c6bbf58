#!/usr/bin/env python3
"""Teaches a running swarm from the keyboard: shows its decision, and what the swarm asks; asks what the gesture really was, prints the answer.

    python3 -m venv venv && . venv/bin/activate && pip install eclipse-zenoh      # needs python3-venv
    python3 examples/teach.py --connect tcp/127.0.0.1:7447 --swarm gestalt

A robot listens there if it is started so: `gestalt peer -c configs/footbot.json5 -l tcp/127.0.0.1:7447`.
Teaching is a put of JSON on `gestalt/<swarm>/instructor/<name>/feedback`; answers come on `…/<name>/answer`.
"""
import argparse
import collections
import json
import sys
import time

import zenoh


def waiting(subscriber, read):
    """What has come, as `read` takes it from JSON, one by one."""
    while (sample := subscriber.try_recv()) is not None:
        try:
            yield read(json.loads(sample.payload.to_bytes().decode(errors="replace")))
        except (ValueError, TypeError, KeyError, OverflowError, RecursionError) as error:
            # In an open swarm anybody may say anything there.
            print(f"passed over on {sample.key_expr}: {error!r}", file=sys.stderr, flush=True)


def wait_for(subscriber, patience: float, read, is_it):
    """The first that is the one, as `read` takes it from JSON, or None when the time is up."""
    end = time.monotonic() + patience
    while time.monotonic() < end:
        message = next(waiting(subscriber, read), None)
        if message is None:
            time.sleep(0.02)
        elif is_it(message):
            return message
    return None


def decided(decision: dict) -> dict:
    """A decision: of which round, and in words."""
    # Whoever says it may have another vocabulary, and no label for it.
    gesture = "no decision" if decision["class"] is None else decision["label"] or f"class {decision['class']}"
    return {"round": decision["round"], "words": f"round {decision['round']['counter']}: {gesture}"}


def asked(question: dict) -> dict:
    """A question: about which round, and in words."""
    return {"round": question["round"], "words": f"{question['ask']['kind']} {' or '.join(question['labels'])}"}


def answered(answer: dict) -> dict:
    """An answer: to which word, and in words."""
    return {"to": answer["to"], "words": f"{answer['outcome']}, {answer['samples']} samples of it"}


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
        # While a person thinks nobody reads: a ring forgets the oldest then, where Zenoh's own queue would hold up its session.
        def ring(key: str):
            return session.declare_subscriber(key, zenoh.handlers.RingChannel(64))

        decisions = ring(f"{prefix}/decision")
        answers = ring(f"{prefix}/instructor/{given.name}/answer")
        questions = ring(f"{prefix}/question")
        known = collections.deque(maxlen=256)
        unanswered = []
        told = iter(given.gestures) if given.gestures is not None else None
        while True:
            said = next(told, "") if told is not None else None
            if said == "":
                break
            # Half a second after a round began, a request to open is taken for an echo of the one before.
            time.sleep(1)
            # What others had decided meanwhile is not what the next word is about.
            known.extend(other["round"] for other in waiting(decisions, decided))
            session.put(feedback, json.dumps({"say": "open"}))
            decision = wait_for(decisions, 15, decided, lambda decision: decision["round"] not in known)
            if decision is None:
                raise SystemExit(f"no decision within 15 s: is a robot of swarm '{given.swarm}' at {given.connect}, and can it decide alone? "
                                 f"gestalt doctor --swarm {given.swarm} -e {given.connect} says what is wrong")
            known.append(decision["round"])
            print(decision["words"], flush=True)
            if told is None:
                # The swarm asks a second after a round that is worth it; any word on the round answers.
                question = wait_for(questions, 2.5, asked, lambda question: question["round"] == decision["round"])
                if question is not None:
                    print(f"  the swarm asks: {question['words']}", flush=True)
            gesture = said or input("it was (empty to end): ").strip()
            if not gesture:
                break
            # Gestures are named by label; a number in JSON would be a class.
            word = {"say": "was", "round": decision["round"], "class": gesture}
            session.put(feedback, json.dumps(word))
            # Others may say something under the same name: the answer names its word.
            answer = wait_for(answers, 10, answered, lambda answer: answer["to"] == word)
            if answer is None:
                print("  no answer within 10 s", flush=True)
                unanswered.append(gesture)
                continue
            print(f"  {answer['words']}", flush=True)
    if unanswered:
        raise SystemExit(f"not answered: {', '.join(unanswered)}; the robot has gone, or passes over what is said; "
                         f"gestalt doctor --swarm {given.swarm} -e {given.connect} says what is wrong")


if __name__ == "__main__":
    try:
        main()
    except (KeyboardInterrupt, EOFError):
        pass
