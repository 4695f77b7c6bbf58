#!/usr/bin/env python3
"""Checks a decision of a sealed swarm without the swarm, and without a line of Gestalt's own code.

    pip install cryptography
    python3 examples/verify.py decision.json --roster keys/roster.json

A member of the roster must have announced it so, every vote that it rests on must be signed by one, and it must follow from them. `--alpha`,
`--clip`, `--liars` and `--committee` are those of the swarm's `rounds`.
"""
import argparse
import collections
import hashlib
import json
import math
import struct
import sys

from cryptography.exceptions import InvalidSignature
from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PublicKey

ROLES = ("open", "teach", "overrule")
VERSION, VOTE, ANNOUNCED = 3, 0, 8
POOLS = ("log_pool", "confidence_weighted", "correlated_pool")
# In the order of their numbers on the wire; 4 is a rule of somebody's own.
RULES = ("majority", "mean_probability", "log_pool", "confidence_weighted", None, "correlated_pool")
PRIOR = {"likeness": 0.5, "temperature": 1.1, "rounds": 0}
ALPHA = {rule: 0.05 for rule in POOLS}
TOLERANCE = 1e-9
GESTURES, WORD = 64, (1 << 64) - 1


class Refused(Exception):
    """Why a decision is none."""


def require(holds: bool, why: str) -> None:
    if not holds:
        raise Refused(why)


def varint(number: int) -> bytes:
    """An unsigned number as postcard writes it: seven bits a byte, the least first."""
    out = bytearray()
    while number >= 0x80:
        out.append(number & 0x7F | 0x80)
        number >>= 7
    out.append(number)
    return bytes(out)


def text(word: str) -> bytes:
    return varint(len(word.encode())) + word.encode()


def verify(key: str, message: bytes, signature: str) -> None:
    Ed25519PublicKey.from_public_bytes(bytes.fromhex(key)).verify(bytes.fromhex(signature), message)


def members(roster: dict) -> bytes:
    """Checks who signed the roster; gives the swarm's id."""
    def entries(of: dict, write, order) -> bytes:
        written = [write(name, entry) for name, entry in sorted(of.items(), key=order)]
        return varint(len(written)) + b"".join(written)

    def robot(number: str, key: str) -> bytes:
        return varint(int(number)) + bytes.fromhex(key)

    def roles(words: list) -> bytes:
        return bytes([sum(1 << ROLES.index(word) for word in words)])

    def instructor(name: str, entry: dict) -> bytes:
        return text(name) + bytes.fromhex(entry["key"]) + roles(entry["roles"])

    by_number, by_name = (lambda item: int(item[0])), (lambda item: item[0])
    body = bytes.fromhex(roster["authority"]) + text(roster["swarm"]) + varint(roster["epoch"])
    body += entries(roster["robots"], robot, by_number)
    body += entries(roster.get("instructors", {}), instructor, by_name)
    body += roles(roster.get("local", []))
    body += entries(roster.get("expelled", {}), robot, by_number)
    verify(roster["authority"], b"gestalt-roster-2\0" + body, roster["signature"])
    return hashlib.sha256(b"gestalt-swarm-1" + bytes.fromhex(roster["authority"]) + roster["swarm"].encode()).digest()


def name(of: dict) -> bytes:
    """A round's."""
    return varint(of["counter"]) + varint(of["opener"]) + varint(of["life"])


def number(of: dict) -> bytes:
    """A stamp's."""
    return varint(of["boot"]) + varint(of["sequence"])


def vector(values: list, kind: str) -> bytes:
    return varint(len(values)) + struct.pack(f"<{len(values)}{kind}", *values)


def maybe(value, write) -> bytes:
    return b"\0" if value is None else b"\1" + write(value)


def gestures(of: dict) -> bytes:
    """Those that were named since the list was made."""
    named = of.get("named", [])
    return varint(len(named)) + b"".join(map(varint, named))


def the_vote(vote: dict) -> bytes:
    return name(vote["round"]) + varint(vote["vocabulary"]) + vector(vote["evidence"], "f") + struct.pack("<f", vote["looks"]) \
        + maybe(vote.get("unknown"), lambda nats: struct.pack("<f", nats)) + gestures(vote)


def the_pool(pool: dict) -> bytes:
    return struct.pack("<2d", pool["likeness"], pool["temperature"]) + varint(pool["rounds"])


def the_terms(terms: dict) -> bytes:
    return struct.pack("<2d", terms["clip"], terms["alpha"]) + bytes([terms["majority"] is True]) \
        + varint(terms["liars"]) + varint(terms["committee"])


def statement(held: dict) -> bytes:
    """The vote as its robot said and signed it."""
    return bytes([VERSION]) + varint(held["robot"]) + number(held["stamp"]) + varint(VOTE) + the_vote(held["vote"])


def counted(held: dict) -> bytes:
    beside = varint(held["class"]) + struct.pack("<f", held["weight"])
    signature = maybe(held["signature"], bytes.fromhex)
    return varint(held["robot"]) + number(held["stamp"]) + beside + the_vote(held["vote"]) + signature


def other(held: dict) -> bytes:
    return varint(held["robot"]) + number(held["stamp"]) + the_vote(held["vote"]) + maybe(held["signature"], bytes.fromhex)


def aloud(said: dict) -> bytes:
    """The decision as its announcer said and signed it, with all that is beside the votes."""
    certificate = said["certificate"]
    votes, others = certificate["votes"], certificate["others"]
    body = name(said["round"]) + maybe(said["class"], varint) + struct.pack("<d", said["confidence"])
    body += varint(said["author"]) + bytes([said["final"] is True]) + varint(certificate["vocabulary"])
    body += varint(RULES.index(certificate["rule"])) + maybe(certificate.get("pool"), the_pool)
    body += vector(certificate["probabilities"], "d") + maybe(certificate.get("unknown"), lambda p: struct.pack("<d", p)) + gestures(certificate)
    body += varint(len(votes)) + b"".join(map(counted, votes)) + varint(len(others)) + b"".join(map(other, others))
    body += varint(certificate["robots"]) + varint(certificate["quorum"]) + varint(certificate["elapsed_ms"])
    body += the_terms(certificate["terms"])
    body += maybe(said["label"], text)
    return bytes([VERSION]) + varint(said["announcer"]) + number(said["stamp"]) + varint(ANNOUNCED) + body


def softmax(row: list) -> list:
    powers = [math.exp(value - max(row)) for value in row]
    return [power / sum(powers) for power in powers]


def certainty(row: list) -> float:
    return 1 + sum(p * math.log(p) for p in softmax(row) if p > 0) / math.log(len(row))


def knows(vote: dict, gesture: int) -> bool:
    """Whether that robot was taught that gesture: to one that was not, it is exactly as likely as what is unknown."""
    evidence, unknown = vote["evidence"], vote.get("unknown")
    if gesture in vote["lacks"]:
        return False
    return evidence[gesture] != unknown if unknown is not None else len(set(evidence)) > 1


def named_by(votes: list, listed: int) -> list:
    """The gestures beyond the list that any of these robots knows; of too many those that most know, then those of the smaller numbers."""
    known_by = collections.Counter(gesture for vote in votes for gesture in vote.get("named", []))
    return sorted(sorted(known_by, key=lambda gesture: (-known_by[gesture], gesture))[:GESTURES - listed])


def lot(counter: int, robot: int) -> int:
    """Who votes of many robots: a number that all draw alike, twice the output function of SplitMix64."""
    def mix(seed: int) -> int:
        z = (seed + 0x9E3779B97F4A7C15) & WORD
        z = (z ^ z >> 30) * 0xBF58476D1CE4E5B9 & WORD
        z = (z ^ z >> 27) * 0x94D049BB133111EB & WORD
        return z ^ z >> 31

    return mix((mix(0x636F6D6D69747465 ^ counter) + robot) & WORD)


def spread(vote: dict, named: list) -> dict:
    """The vote over those of the list and these: of one that its robot does not know, it says what it says of unknown."""
    of_vote = vote.get("named", [])
    listed = len(vote["evidence"]) - len(of_vote)
    beyond = dict(zip(of_vote, vote["evidence"][listed:]))
    unknown = vote.get("unknown")
    evidence = vote["evidence"][:listed] + [beyond.get(gesture, 0.0 if unknown is None else unknown) for gesture in named]
    lacks = {listed + place for place, gesture in enumerate(named) if gesture not in beyond}
    return {"evidence": evidence, "unknown": unknown, "lacks": lacks}


def sharpness(pool: dict, voices: float) -> float:
    """By what the sum of the evidence of so many equal voices is multiplied, for they repeat each other."""
    return 1 / (pool["temperature"] * (1 + max(voices - 1, 0) * pool["likeness"]))


def voices(rows: list) -> float:
    """How many equal voices there are: Kish's effective number."""
    strengths = [math.sqrt(sum((value - sum(row) / len(row)) ** 2 for value in row)) for row in rows]
    squares = sum(strength * strength for strength in strengths)
    return sum(strengths) ** 2 / squares if squares > 0 else 1.0


def fuse(rule: str, votes: list, clip: float, pool: dict) -> tuple:
    """The probability of each class, and what each vote adds to its total."""
    rows = [[min(max(value, -clip), clip) for value in vote] for vote in votes]
    if rule == "majority":
        # Who finds two classes equally likely abstains.
        parts = [[float(value == max(row)) for value in row] for row in rows if row.count(max(row)) == 1]
        require(bool(parts), "all abstain")
    else:
        parts = {"mean_probability": [softmax(row) for row in rows], "log_pool": rows, "correlated_pool": rows,
                 "confidence_weighted": [[certainty(row) * value for value in row] for row in rows]}[rule]
    totals = [sum(column) for column in zip(*parts)]
    if rule == "correlated_pool":
        totals = [sharpness(pool, voices(rows)) * total for total in totals]
    return softmax(totals) if rule in POOLS else [total / len(parts) for total in totals], parts


def least(rule: str, parts: list, top: int, liars: int, probability: float) -> float:
    """The least probability that a class keeps, whichever so many votes are left out; 0 where another class may lead."""
    def left(values) -> float:
        return sum(sorted(values)[:len(parts) - liars])

    leads = [left(part[top] - part[rival] for part in parts) for rival in range(len(parts[0])) if rival != top]
    if len(parts) <= liars or min(leads) <= 0:
        return 0.0
    if rule == "correlated_pool":
        if liars == 0:
            return probability
        leads = [sharpness(PRIOR, len(parts) - liars) * lead for lead in leads]
    if rule in POOLS:
        return 1 / (1 + sum(math.exp(-lead) for lead in leads))
    return left(part[top] for part in parts) / (len(parts) - liars)


def judge(rule: str, votes: list, given: argparse.Namespace, pool: dict) -> tuple:
    """The probability of each gesture, and of unknown where any robot tells; and of the likeliest what is left of it if so many of the robots lied.

    First whether it is a gesture that any robot was taught, of which all are one witness; then, by the rule, which of these."""
    clip, gestures = given.clip, range(len(votes[0]["evidence"]))
    tell = [vote for vote in votes if vote.get("unknown") is not None]
    known_by = [sum(knows(vote, k) for vote in votes) for k in gestures]

    def clipped(value: float) -> float:
        return min(max(value, -clip), clip)

    def more_than(robots: int) -> list:
        return [k for k in gestures if not tell or known_by[k] > robots]

    def which(of: list) -> tuple:
        rows = [[vote["evidence"][k] for k in of] for vote in votes]
        return fuse(rule, rows, clip, pool) if len(of) > 1 else ([1.0] * len(of), [])

    def which_at_least(of: list, top: int, liars: int) -> float:
        probabilities, parts = which(of)
        if top not in of or probabilities[of.index(top)] < max(probabilities):
            return 0.0
        return least(rule, parts, of.index(top), liars, probabilities[of.index(top)]) if len(of) > 1 else 1.0

    def taught(of: list, liars: int) -> tuple:
        """How likely it is one of these, and each other one."""
        odds = sorted(math.log(sum(math.exp(clipped(vote["evidence"][k]) - clipped(vote["unknown"])) for k in of)) if of else -math.inf
                      for vote in tell)[:len(tell) - liars]
        odds = math.exp(sum(odds) / len(odds)) if odds else 0.0
        others = len(gestures) - len(of) + 1
        return odds / (odds + others), 1 / (odds + others)

    of, liars = more_than(0), given.liars
    chosen, _ = which(of)
    probabilities = chosen
    if tell:
        known, each = taught(of, 0)
        probabilities = [each] * (len(gestures) + 1)
        for k, p in zip(of, chosen):
            probabilities[k] = p * known
    top = probabilities.index(max(probabilities))
    if top not in of:
        return probabilities, 0.0
    sure = which_at_least(of, top, liars)
    if tell and liars == 0:
        sure = min(sure, probabilities[top]) if sure > 0 else 0.0
    elif tell:
        # What liars pretend to have been taught is nobody's gesture without them.
        firm = more_than(liars)
        sure = taught(firm, liars)[0] * min(sure, which_at_least(firm, top, liars))
        if rule == "majority":
            # Nor can they make those abstain who find it likelier than all else.
            always = sum(all(vote["evidence"][k] < vote["evidence"][top] for k in gestures if k != top) for vote in votes)
            sure = min(sure, taught(firm, liars)[0] * max(always - liars, 0) / (len(votes) - liars)) if len(votes) > liars else 0.0
    return probabilities, sure


def decides(rule: str, votes: list, given: argparse.Namespace, alpha: float, pool: dict) -> bool:
    """Whether votes that are enough make a gesture likely enough."""
    try:
        return judge(rule, votes, given, pool)[1] - TOLERANCE >= 1 - alpha
    except Refused:
        return False


def single(value: float) -> float:
    """The 32-bit float nearest to it: robots write its shortest digits, and compute with the float."""
    return struct.unpack("<f", struct.pack("<f", value))[0]


def as_computed(decision: dict) -> None:
    """What robots hold as 32-bit floats becomes such, before anything is computed."""
    certificate = decision["certificate"]
    for held in certificate["votes"]:
        held["weight"] = single(held["weight"])
    for held in certificate["votes"] + certificate["others"]:
        vote = held["vote"]
        vote["evidence"] = [single(nats) for nats in vote["evidence"]]
        vote["looks"] = single(vote["looks"])
        if vote.get("unknown") is not None:
            vote["unknown"] = single(vote["unknown"])


def check(decision: dict, roster: dict, given: argparse.Namespace) -> str:
    as_computed(decision)
    swarm, certificate = members(roster), decision["certificate"]
    votes, others = certificate["votes"], certificate["others"]

    def signed(by: int, said: bytes, signature: str, what: str) -> None:
        require(str(by) in roster["robots"], f"robot {by} is no member")
        require(bool(signature), f"{what} of robot {by} is not signed")
        verify(roster["robots"][str(by)], b"gestalt-statement-1\0" + swarm + said, signature)

    require(decision["final"] in (True, False), "neither final nor not")
    signed(decision["announcer"], aloud(decision), decision["signature"], "the announcement")
    robots = [held["robot"] for held in votes + others]
    require(len(set(robots)) == len(robots), "a robot is counted twice")
    for held in votes + others:
        require(held["vote"]["round"]["counter"] == decision["round"]["counter"], "a vote of another round")
        signed(held["robot"], statement(held), held["signature"], "the vote")
    named = certificate.get("named", [])
    listed = len(certificate["probabilities"]) - len(named)
    over = [len(held["vote"]["evidence"]) - len(held["vote"].get("named", [])) for held in votes]
    require(all(gestures == listed for gestures in over), "a vote over other gestures")
    require(named == (named_by([held["vote"] for held in votes], listed) if certificate["probabilities"] else []), "gestures that no vote names")
    require(all(held["vote"]["vocabulary"] == certificate["vocabulary"] for held in votes), "a vote over other gestures")
    aside = [held for held in others if votes and held["vote"]["vocabulary"] == certificate["vocabulary"]]
    require(not any(len(held["vote"]["evidence"]) - len(held["vote"].get("named", [])) == listed for held in aside), "a vote laid aside")

    def suffice(all_of: int) -> tuple:
        """How many of so many robots are to take part, whether they do, and whether enough of them gave evidence."""
        # What a robot said before it saw anything proves nothing where liars are expected.
        counting, gave, needed = votes if given.liars else votes + others, votes, (all_of + given.liars) // 2 + 1
        committee = given.committee + 4 * given.liars
        if given.committee and all_of > committee + committee // 2:
            # Only those count who were drawn, or may have been by robots that know of half as many.
            drawn = {held["robot"] for held in votes + others
                     if lot(decision["round"]["counter"], held["robot"]) < min((committee << 65) // all_of, WORD)}
            counting, gave = ([held for held in of if held["robot"] in drawn] for of in (counting, gave))
            needed = committee // 2 + 1 + given.liars
        return needed, len(counting) >= needed, given.liars == 0 or len(gave) > 2 * given.liars

    needed, majority, enough = suffice(certificate["robots"])
    rule = certificate["rule"]
    alpha = given.alpha or ALPHA.get(rule, 0.5)
    terms = {"clip": given.clip, "alpha": alpha, "majority": True, "liars": given.liars, "committee": given.committee}
    require(certificate["terms"] == terms, f"decided by other terms than {terms}")
    require(certificate["quorum"] == needed, "another quorum than that of so many robots")
    pool, unknown = certificate.get("pool"), certificate.get("unknown")
    require((pool is not None) == (rule == "correlated_pool"), "a pool that is none, or none where there must be one")
    require(given.liars == 0 or pool in (None, PRIOR), "a pool that a liar may have chosen")
    if pool is not None:
        likeness, temperature = pool["likeness"], pool["temperature"]
        require(0 <= likeness <= 1 and 0.1 <= temperature <= 10, "an impossible pool")
        require(round(likeness * 20) / 20 == likeness and round(temperature * 100) / 100 == temperature, "a pool between the steps")
    evidence = [spread(held["vote"], named) for held in votes]
    if decision["class"] is None:
        if majority and enough and votes:
            require(not decides(rule, evidence, given, alpha, pool), "the votes suffice for a gesture")
        return f"nothing was decided, and {len(robots)} of {certificate['robots']} robots took part"
    require(majority, "no majority took part")
    require(enough, "too few votes for so many liars")
    # How many robots there were is its author's word.
    require(suffice(max(certificate["robots"], given.robots))[1:] == (True, True), f"too few of {given.robots} robots took part")
    probabilities, sure = judge(rule, evidence, given, pool)
    places = list(range(listed)) + named
    require(decision["class"] in places, "a gesture that no vote is about")
    of_class = probabilities[places.index(decision["class"])]
    said = certificate["probabilities"] + ([] if unknown is None else [unknown])
    require(len(said) == len(probabilities), "unknown where no vote tells it, or none where one does")
    require(all(abs(a - b) <= TOLERANCE for a, b in zip(probabilities, said)), "other probabilities")
    require(abs(of_class - decision["confidence"]) <= TOLERANCE, "another confidence")
    require(abs(of_class - max(probabilities)) <= TOLERANCE, "another class is likelier")
    require(sure + TOLERANCE >= 1 - alpha, "the votes do not suffice")
    return f"class {decision['class']}, p = {of_class:.3f}, by {len(robots)} of {certificate['robots']} robots"


def main() -> None:
    arguments = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    arguments.add_argument("decision", help="what stood on gestalt/<swarm>/decision, JSON; - for standard input")
    arguments.add_argument("--roster", required=True, help="the swarm's roster.json")
    arguments.add_argument("--alpha", type=float, help="by default that of the rule: 0.05 for the pools, 0.5 for the others")
    arguments.add_argument("--clip", type=float, default=6.0)
    arguments.add_argument("--liars", type=int, default=0)
    arguments.add_argument("--committee", type=int, default=72, help="of more robots than half as many again, so many vote; 0: always all")
    arguments.add_argument("--robots", type=int, default=1, help="how many robots there were at least, if that is known: of how many it was is its author's word")
    given = arguments.parse_args()
    with sys.stdin if given.decision == "-" else open(given.decision, encoding="utf-8") as file:
        decision = json.load(file)
    with open(given.roster, encoding="utf-8") as file:
        roster = json.load(file)
    try:
        print(f"proven: round {decision['round']['counter']}, {check(decision, roster, given)}")
    except Refused as error:
        sys.exit(f"refused: {error}")
    except InvalidSignature:
        sys.exit("refused: a signature is not its author's")
    except (KeyError, IndexError, TypeError, ValueError, struct.error) as error:
        sys.exit(f"refused: no decision, or no roster: {error!r}")


if __name__ == "__main__":
    main()
