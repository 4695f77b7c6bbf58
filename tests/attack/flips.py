#!/usr/bin/env python3
"""Shows examples/verify.py a decision with each of its bytes flipped, in one process.

Reads {"decision": …, "roster": "…"} from standard input. Ends with status 1 if one is proven that differs in anything.
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

RULES = argparse.Namespace(alpha=0.05, clip=6.0, liars=0, committee=72, robots=1)
NO_DECISION = (verify.Refused, verify.InvalidSignature, KeyError, IndexError, TypeError, ValueError, struct.error,
               AttributeError, OverflowError)


def main() -> None:
    shown = json.load(sys.stdin)
    roster, truly = json.loads(shown["roster"]), shown["decision"]
    print(verify.check(truly, roster, RULES))
    text, refused = json.dumps(truly).encode(), 0
    for place in range(len(text)):
        flipped = bytearray(text)
        flipped[place] ^= 1
        try:
            decision = json.loads(flipped)
            verify.check(decision, roster, RULES)
        except NO_DECISION:
            refused += 1
            continue
        # Digits beyond those of a 32-bit float are not there for anybody.
        if verify.aloud(decision) != verify.aloud(truly):
            sys.exit(f"byte {place} makes another decision, which is proven: {decision}")
    print(f"{refused} of {len(text)} refused")


if __name__ == "__main__":
    main()
