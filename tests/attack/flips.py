#!/usr/bin/env python3
"""Shows examples/verify.py a decision with each of its bytes flipped, in one process.

Reads {"decision": …, "roster": "…"} from standard input. Ends with status 1 if one is proven that differs in anything.
"""
import argparse
import importlib.util
import json
import pathlib
import sys

HERE = pathlib.Path(__file__).resolve()
spec = importlib.util.spec_from_file_location("verify", HERE.parents[2] / "examples" / "verify.py")
verify = importlib.util.module_from_spec(spec)
spec.loader.exec_module(verify)

RULES = argparse.Namespace(rule="correlated_pool", alpha=None, clip=6.0, quorum=None, liars=0, committee=72, robots=1)
NO_DECISION = (verify.Refused, verify.InvalidSignature, ValueError, OverflowError)


def read(decision: bytes) -> dict:
    return verify.DECISION(verify.document(decision, verify.LONGEST))


def main() -> None:
    shown = json.load(sys.stdin)
    roster, text, refused = shown["roster"].encode(), json.dumps(shown["decision"]).encode(), 0
    print(verify.prove(text, roster, RULES))
    for place in range(len(text)):
        flipped = bytearray(text)
        flipped[place] ^= 1
        try:
            verify.prove(bytes(flipped), roster, RULES)
        except NO_DECISION:
            refused += 1
            continue
        # Digits beyond those of a 32-bit float are not there for anybody.
        if verify.aloud(read(bytes(flipped))) != verify.aloud(read(text)):
            sys.exit(f"byte {place} makes another decision, which is proven: {flipped.decode()}")
    print(f"{refused} of {len(text)} refused")


if __name__ == "__main__":
    main()
