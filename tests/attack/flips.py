#!/usr/bin/env python3
"""Shows examples/verify.py a decision with each of its bytes flipped, in one process.

Reads {"decision": …, "roster": "…"} from standard input. Ends with status 1 if one is proven that says something else than the
decision itself: another gesture, other votes or another probability.
"""
import argparse
import importlib.util
import json
import pathlib
import struct
import sys

HERE = pathlib.Path(__file__).resolve()
spec = importlib.util.spec_from_file_location("verify", HERE.parents[2] / "examples" / "verify.py")
verify = importlib.util.module_from_spec(spec)
spec.loader.exec_module(verify)

RULES = argparse.Namespace(alpha=0.05, clip=6.0, liars=0)
NO_DECISION = (verify.Refused, verify.InvalidSignature, KeyError, IndexError, TypeError, ValueError, struct.error,
               AttributeError, OverflowError)


def proven(decision: dict) -> tuple:
    """What a decision says, as far as its votes prove it."""
    certificate = decision["certificate"]
    votes = sorted((verify.statement(held), held["signature"]) for held in certificate["votes"] + certificate["others"])
    probabilities = [round(p, 6) for p in [decision["confidence"], *certificate["probabilities"]]]
    return decision["round"]["counter"], decision["class"], certificate["rule"], probabilities, votes


def main() -> None:
    shown = json.load(sys.stdin)
    roster, truly = json.loads(shown["roster"]), shown["decision"]
    print(verify.check(truly, roster, RULES))
    original, text, refused = proven(truly), json.dumps(truly).encode(), 0
    for place in range(len(text)):
        flipped = bytearray(text)
        flipped[place] ^= 1
        try:
            decision = json.loads(flipped)
            verify.check(decision, roster, RULES)
        except NO_DECISION:
            refused += 1
            continue
        if proven(decision) != original:
            sys.exit(f"byte {place} makes another decision, which is proven: {decision}")
    print(f"{refused} of {len(text)} refused")


if __name__ == "__main__":
    main()
