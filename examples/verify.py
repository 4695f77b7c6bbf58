#!/usr/bin/env python3
"""Checks a decision of a sealed swarm without the swarm, and without a line of Gestalt's own code.

    sudo apt install python3-cryptography
    python3 examples/verify.py decision.json --roster keys/roster.json

A member of the roster must have announced it so, every vote that it rests on must be signed by one, and it must follow from them. `--rule`, `--alpha`,
`--clip`, `--quorum`, `--liars` and `--committee` are those of the swarm's `rounds`. It proves the same files as `gestalt verify`. What the gesture is called is its
announcer's word alone, as are who drew the decision, how long that took, and whether it is final: act on its `class`.
"""
import argparse
import collections
import decimal
import hashlib
import json
import math
import re
import struct
import sys

try:
    from cryptography.exceptions import InvalidSignature
    from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PublicKey
except ImportError:
    sys.exit("verify.py checks signatures by another library: sudo apt install python3-cryptography, or in a virtual environment pip install cryptography")

ROLES = ("open", "teach", "overrule")
VERSION, VOTE, ANNOUNCED = 3, 0, 8
POOLS = ("log_pool", "confidence_weighted", "correlated_pool")
# In the order of their numbers on the wire; 4 is a rule of somebody's own.
RULES = ("majority", "mean_probability", "log_pool", "confidence_weighted", None, "correlated_pool")
PRIOR = {"likeness": 0.5, "temperature": 1.1, "rounds": 0}
ALPHA = {rule: 0.05 for rule in POOLS}
TOLERANCE = 1e-9
GESTURES, ROBOTS, INSTRUCTORS, WORD = 64, 4096, 256, (1 << 64) - 1
LONGEST, LONGEST_ROSTER, LONGEST_STATEMENT = 2 << 20, 512 << 10, 512 << 10
NAMED = range(1 << 27, 1 << 28)


class Refused(Exception):
    """Why a decision is none."""


def require(holds: bool, why: str) -> None:
    if not holds:
        raise Refused(why)


# ---- Reading: as robots and `gestalt trust` write it and not otherwise, so that nobody reads another decision in a file that was proven


class Whole(str):
    """A number without point and exponent, as it is written."""


class Real(str):
    """Any other number, as it is written."""


def document(text: bytes, longest: int) -> object:
    def once(pairs: list) -> dict:
        require(len(dict(pairs)) == len(pairs), "a field is there twice")
        return dict(pairs)

    def never(constant: str) -> None:
        raise Refused(f"{constant} is no number")

    require(len(text) <= longest, f"more than {longest} bytes")
    return json.loads(text.decode(), object_pairs_hook=once, parse_int=Whole, parse_float=Real, parse_constant=never)


def whole(bits: int):
    def read(value: object) -> int:
        require(type(value) is Whole and value.isdigit() and len(value) <= 20 and int(value) < 1 << bits, "no whole number within its bounds")
        return int(value)

    return read


def real(value: object) -> float:
    require(type(value) in (Whole, Real) and math.isfinite(float(value)), "no number")
    return float(value)


def rounded(value: float) -> float:
    """The 32-bit float nearest to it."""
    return struct.unpack("<f", struct.pack("<f", value))[0]


def single(value: object) -> float:
    """A 32-bit float: robots write its shortest digits and compute with the float. To round it to 64 bits first may be to round it otherwise, so these become
    odd where digits are left over. Whole numbers from -2^63 down to -2^64, which no robot writes, robots do read as 64 bits first."""
    double = real(value)
    if type(value) is Whole and value.startswith("-") and 1 << 63 < int(value[1:]) < 1 << 64:
        return rounded(double)
    left_over = decimal.Decimal(value).copy_abs().compare(decimal.Decimal(abs(double))) if double else 0
    bits, = struct.unpack("<Q", struct.pack("<d", double))
    return rounded(struct.unpack("<d", struct.pack("<Q", bits - (left_over < 0) | (left_over != 0)))[0])


def boolean(value: object) -> bool:
    require(type(value) is bool, "neither true nor false")
    return value


def word(form: str):
    def read(value: object) -> str:
        require(type(value) is str and re.fullmatch(form, value, re.DOTALL) is not None, "no text of its form")
        value.encode()
        return value

    return read


def digits(length: int):
    """So many bytes: their digits, in lower case."""
    return word("[0-9a-f]{%d}" % (2 * length))


def optional(read):
    return lambda value: None if value is None else read(value)


def list_of(read, most: int):
    def read_all(values: object) -> list:
        require(type(values) is list and len(values) <= most, "no list within its bounds")
        return [read(value) for value in values]

    return read_all


def table(name, read, most: int):
    def read_all(of: object) -> dict:
        require(type(of) is dict and len(of) <= most, "no members within their bounds")
        return {name(of_whom): read(value) for of_whom, value in of.items()}

    return read_all


def record(fields: dict, left_out: dict = {}):
    """Each of the fields, but those that may be left out, and no other."""
    def read(of: object) -> dict:
        require(type(of) is dict and {**left_out, **of}.keys() == fields.keys(), "a field is lacking, or is there beside those there are")
        return {**left_out, **{field: fields[field](value) for field, value in of.items()}}

    return read


U32 = whole(32)
ROUND = record({"counter": U32, "opener": U32, "life": U32})
STAMP = record({"boot": U32, "sequence": U32})
CAST = record({"round": ROUND, "vocabulary": U32, "evidence": list_of(single, GESTURES), "looks": single, "unknown": optional(single),
               "named": list_of(U32, GESTURES)})
HELD = {"robot": U32, "stamp": STAMP, "vote": CAST, "signature": optional(digits(64))}
CERTIFICATE = record({
    "vocabulary": U32, "rule": word("|".join(filter(None, RULES))), "pool": optional(record({"likeness": real, "temperature": real, "rounds": whole(16)})),
    "probabilities": list_of(real, GESTURES), "unknown": optional(real), "named": list_of(U32, GESTURES),
    "votes": list_of(record({**HELD, "class": U32, "weight": single}), ROBOTS), "others": list_of(record(HELD), ROBOTS),
    "robots": U32, "quorum": U32, "elapsed_ms": U32,
    "terms": record({"clip": real, "alpha": real, "majority": boolean, "liars": U32, "committee": U32}),
})
DECISION = record({
    "round": ROUND, "class": optional(U32), "confidence": real, "author": U32, "final": boolean, "certificate": CERTIFICATE,
    "label": optional(word(".*")), "announcer": U32, "stamp": STAMP, "signature": optional(digits(64)),
})
NUMBER, NAME = word("0|[1-9][0-9]{0,9}"), word("[A-Za-z0-9_-]{1,32}")
ROSTER = record({
    "swarm": word("[A-Za-z0-9_-]{1,64}"), "authority": digits(32), "epoch": whole(64), "robots": table(NUMBER, digits(32), ROBOTS),
    "instructors": table(NAME, record({"key": digits(32), "roles": list_of(word("|".join(ROLES)), len(ROLES))}), INSTRUCTORS),
    "local": list_of(word("|".join(ROLES)), len(ROLES)), "expelled": table(NUMBER, digits(32), ROBOTS), "signature": digits(64),
}, {"instructors": {}, "local": [], "expelled": {}})


# ---- Signatures


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


P = (1 << 255) - 19
D = -121665 * pow(121666, -1, P) % P
# The five heights of the eight points of small order, by which whoever signs could have two messages under one signature.
EIGHTH = int.from_bytes(bytes.fromhex("26e8958fc2b227b045c3f489f2ef98f0d5dfac05d3c63339b13802886d53fc05"), "little")
SMALL = (0, 1, P - 1, EIGHTH, P - EIGHTH)


def height(point: str) -> int:
    return int.from_bytes(bytes.fromhex(point), "little") & (1 << 255) - 1


def is_key(key: str) -> bool:
    """Whether that is a point in its one spelling, and not of small order."""
    y = height(key)
    return y < P and y not in SMALL and pow((y * y - 1) * pow(D * y * y + 1, -1, P), (P - 1) // 2, P) == 1


def verify(key: str, message: bytes, signature: str) -> None:
    """By the strict rule of Ed25519, which leaves whoever checks no choice."""
    require(height(signature[:64]) not in SMALL, "a signature of small order")
    Ed25519PublicKey.from_public_bytes(bytes.fromhex(key)).verify(bytes.fromhex(signature), message)


def members(roster: dict) -> bytes:
    """Checks who signed the roster, and that its members go together; gives the swarm's id."""
    def entries(of: dict, write, order) -> bytes:
        written = [write(name, entry) for name, entry in sorted(of.items(), key=order)]
        return varint(len(written)) + b"".join(written)

    def robot(number: str, key: str) -> bytes:
        return varint(int(number)) + bytes.fromhex(key)

    def roles(words: list) -> bytes:
        require(words == [role for role in ROLES if role in words], "roles that are not in their order")
        return bytes([sum(1 << ROLES.index(word) for word in words)])

    def instructor(name: str, entry: dict) -> bytes:
        return text(name) + bytes.fromhex(entry["key"]) + roles(entry["roles"])

    by_number, by_name = (lambda item: int(item[0])), (lambda item: item[0])
    body = bytes.fromhex(roster["authority"]) + text(roster["swarm"]) + varint(roster["epoch"])
    body += entries(roster["robots"], robot, by_number)
    body += entries(roster["instructors"], instructor, by_name)
    body += roles(roster["local"])
    body += entries(roster["expelled"], robot, by_number)
    keys = [*roster["robots"].values(), *(entry["key"] for entry in roster["instructors"].values())]
    require(all(map(is_key, [roster["authority"], *keys])), "a key that is none")
    require(all(int(number) < 1 << 32 for number in [*roster["robots"], *roster["expelled"]]), "a robot that has no number")
    require(len(set(keys)) == len(keys) and not set(keys) & set(roster["expelled"].values()), "a key of two members, or of one that was expelled")
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
    return varint(len(of["named"])) + b"".join(map(varint, of["named"]))


def the_vote(vote: dict) -> bytes:
    return name(vote["round"]) + varint(vote["vocabulary"]) + vector(vote["evidence"], "f") + struct.pack("<f", vote["looks"]) \
        + maybe(vote["unknown"], lambda nats: struct.pack("<f", nats)) + gestures(vote)


def the_pool(pool: dict) -> bytes:
    return struct.pack("<2d", pool["likeness"], pool["temperature"]) + varint(pool["rounds"])


def the_terms(terms: dict) -> bytes:
    return struct.pack("<2d", terms["clip"], terms["alpha"]) + bytes([terms["majority"]]) + varint(terms["liars"]) + varint(terms["committee"])


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
    body += varint(said["author"]) + bytes([said["final"]]) + varint(certificate["vocabulary"])
    body += varint(RULES.index(certificate["rule"])) + maybe(certificate["pool"], the_pool)
    body += vector(certificate["probabilities"], "d") + maybe(certificate["unknown"], lambda p: struct.pack("<d", p)) + gestures(certificate)
    body += varint(len(votes)) + b"".join(map(counted, votes)) + varint(len(others)) + b"".join(map(other, others))
    body += varint(certificate["robots"]) + varint(certificate["quorum"]) + varint(certificate["elapsed_ms"])
    body += the_terms(certificate["terms"])
    body += maybe(said["label"], text)
    return bytes([VERSION]) + varint(said["announcer"]) + number(said["stamp"]) + varint(ANNOUNCED) + body


# ---- What no robot may say


def ascending(values: list) -> bool:
    return all(a < b for a, b in zip(values, values[1:]))


def are_named(named: list, among: list) -> bool:
    return len(named) <= len(among) and ascending(named) and all(gesture in NAMED for gesture in named)


def listed(of: list, named: list) -> int:
    """Of how many gestures of the list these values are, those that were named coming last."""
    return len(of) - len(named)


def sound(decision: dict) -> None:
    certificate = decision["certificate"]
    votes, others, named, probabilities = (certificate[field] for field in ("votes", "others", "named", "probabilities"))
    said = [decision["confidence"], *probabilities, *([] if certificate["unknown"] is None else [certificate["unknown"]])]
    require(are_named(named, probabilities), "gestures that were not named, twice, or out of order")
    require(all(0 <= p <= 1 for p in said), "a probability outside 0 to 1")
    label = decision["label"]
    require(label is None or decision["class"] is not None and len(label.encode()) <= 99, "a label of no gesture")
    terms, pool = certificate["terms"], certificate["pool"]
    require(0 < terms["clip"] <= 1000 and 0 < terms["alpha"] <= 0.5, "terms that no robot can decide by")
    if pool is not None:
        likeness, temperature = pool["likeness"], pool["temperature"]
        require(0 <= likeness <= 1 and 0.1 <= temperature <= 10, "an impossible pool")
        require(round(likeness * 20) / 20 == likeness and round(temperature * 100) / 100 == temperature, "a pool between the steps")
    known = [*range(listed(probabilities, named)), *named]
    require(decision["class"] in (None, *known) and all(held["class"] in known for held in votes), "a gesture that no vote is about")
    require(all(held["weight"] >= 0 for held in votes), "a negative weight")
    robots = [[held["robot"] for held in of] for of in (votes, others)]
    require(all(map(ascending, robots)) and not set(robots[0]) & set(robots[1]), "a robot is counted twice, or out of order")
    for vote in (held["vote"] for held in votes + others):
        require(are_named(vote["named"], vote["evidence"]), "gestures that were not named, twice, or out of order")
        require(not vote["evidence"] or listed(vote["evidence"], vote["named"]) >= 2, "evidence over fewer than two gestures of the list")
        require(vote["unknown"] is None or bool(vote["evidence"]), "evidence for unknown where nothing was seen")
        require(vote["looks"] >= 0, "a negative number of looks")


# ---- What follows from votes


def exp(value: float) -> float:
    try:
        return math.exp(value)
    except OverflowError:
        return math.inf


def softmax(row: list) -> list:
    powers = [math.exp(value - max(row)) for value in row]
    return [power / sum(powers) for power in powers]


def certainty(row: list) -> float:
    return min(max(1 + sum(p * math.log(p) for p in softmax(row) if p > 0) / math.log(len(row)), 0.0), 1.0)


def clipped(row: list, clip: float) -> list:
    return [min(max(value, -clip), clip) for value in row]


def weight(rule: str, evidence: list, clip: float) -> float:
    """What a vote weighs: its certainty where that is asked for, nothing where it abstains, else 1."""
    row = clipped(evidence, clip)
    if rule == "majority":
        return float(row.count(max(row)) == 1)
    return rounded(certainty(row)) if rule == "confidence_weighted" else 1.0


def knows(vote: dict, gesture: int) -> bool:
    """Whether that robot was taught that gesture: to one that was not, it is exactly as likely as what is unknown."""
    evidence, unknown = vote["evidence"], vote["unknown"]
    if gesture in vote["lacks"]:
        return False
    return evidence[gesture] != unknown if unknown is not None else any(value != evidence[gesture] for value in vote["said"])


def named_by(votes: list, listed: int) -> list:
    """The gestures beyond the list that any of these robots knows; of too many those that most know, then those of the smaller numbers."""
    known_by = collections.Counter(gesture for vote in votes for gesture in vote["named"])
    return sorted(sorted(known_by, key=lambda gesture: (-known_by[gesture], gesture))[:max(GESTURES - listed, 0)])


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
    of_list = listed(vote["evidence"], vote["named"])
    beyond = dict(zip(vote["named"], vote["evidence"][of_list:]))
    unknown = vote["unknown"]
    evidence = vote["evidence"][:of_list] + [beyond.get(gesture, 0.0 if unknown is None else unknown) for gesture in named]
    lacks = {of_list + place for place, gesture in enumerate(named) if gesture not in beyond}
    return {"evidence": evidence, "unknown": unknown, "lacks": lacks, "said": vote["evidence"]}


def sharpness(pool: dict, voices: float) -> float:
    """By what the sum of the evidence of so many equal voices is multiplied, for they repeat each other."""
    return 1 / (pool["temperature"] * (1 + max(voices - 1, 0) * pool["likeness"]))


def voices(rows: list) -> float:
    """How many equal voices there are: Kish's effective number."""
    strengths = [math.sqrt(sum((value - sum(row) / len(row)) ** 2 for value in row)) for row in rows]
    squares = sum(strength * strength for strength in strengths)
    return sum(strengths) ** 2 / squares if squares > 0 else 1.0


def fuse(rule: str, votes: list, clip: float, pool: dict) -> tuple:
    """The probability of each class, and what each vote adds to its total; none where all abstain."""
    rows = [clipped(vote, clip) for vote in votes]
    if rule == "majority":
        # Who finds two classes equally likely abstains.
        parts = [[float(value == max(row)) for value in row] for row in rows if row.count(max(row)) == 1]
    else:
        parts = {"mean_probability": [softmax(row) for row in rows], "log_pool": rows, "correlated_pool": rows,
                 "confidence_weighted": [[certainty(row) * value for value in row] for row in rows]}[rule]
    if not parts:
        return None, parts
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
        return 1 / (1 + sum(exp(-lead) for lead in leads))
    return left(part[top] for part in parts) / (len(parts) - liars)


def judge(rule: str, votes: list, given: argparse.Namespace, pool: dict) -> tuple:
    """The probability of each gesture, and of unknown where any robot tells; and of the likeliest what is left of it if so many of the robots lied.

    First whether it is a gesture that any robot was taught, of which all are one witness; then, by the rule, which of these. None where all abstain."""
    clip, gestures = given.clip, range(len(votes[0]["evidence"]))
    tell = [vote for vote in votes if vote["unknown"] is not None]
    known_by = [sum(knows(vote, k) for vote in votes) for k in gestures]

    def bounded(value: float) -> float:
        return min(max(value, -clip), clip)

    def more_than(robots: int) -> list:
        return [k for k in gestures if not tell or known_by[k] > robots]

    def which(of: list) -> tuple:
        rows = [[vote["evidence"][k] for k in of] for vote in votes]
        return fuse(rule, rows, clip, pool) if len(of) > 1 else ([1.0] * len(of), [])

    def which_at_least(of: list, top: int, liars: int) -> float:
        probabilities, parts = which(of)
        if probabilities is None or top not in of or probabilities[of.index(top)] < max(probabilities):
            return 0.0
        return least(rule, parts, of.index(top), liars, probabilities[of.index(top)]) if len(of) > 1 else 1.0

    def taught(of: list, liars: int) -> tuple:
        """How likely it is one of these, and each other one."""
        each = [sum(exp(bounded(vote["evidence"][k]) - bounded(vote["unknown"])) for k in of) for vote in tell]
        odds = sorted(math.log(one) if one > 0 else -math.inf for one in each)[:max(len(tell) - liars, 0)]
        odds = sum(odds) / len(odds) if odds else -math.inf
        # The form that cannot overflow.
        known, other = (1.0, exp(-odds)) if odds > 0 else (exp(odds), 1.0)
        total = known + (len(gestures) - len(of) + 1) * other
        return known / total, other / total

    of, liars = more_than(0), given.liars
    chosen, _ = which(of)
    if chosen is None:
        return None, 0.0
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


def follows(decision: dict, given: argparse.Namespace) -> str:
    """Whether robots of these rounds decide so on these votes."""
    certificate = decision["certificate"]
    votes, others, rule, pool = (certificate[field] for field in ("votes", "others", "rule", "pool"))
    named, counter = certificate["named"], decision["round"]["counter"]
    of_list, voted = listed(certificate["probabilities"], named), [held["vote"] for held in votes]

    def is_counted(vote: dict) -> bool:
        return listed(vote["evidence"], vote["named"]) == of_list and vote["vocabulary"] == certificate["vocabulary"]

    require(all(held["vote"]["round"]["counter"] == counter for held in votes + others), "a vote of another round")
    require(all(map(is_counted, voted)), "a vote over other gestures")
    require(not (votes and any(is_counted(held["vote"]) for held in others)), "a vote laid aside")
    require(named == named_by(voted, of_list), "gestures that no vote names")

    require(rule == given.rule, f"fused by {rule}, and not by {given.rule}")
    alpha = ALPHA.get(rule, 0.5) if given.alpha is None else given.alpha
    terms = {"clip": given.clip, "alpha": alpha, "majority": given.quorum is None, "liars": given.liars, "committee": given.committee}
    require(certificate["terms"] == terms, f"decided by other terms than {terms}")
    require((pool is not None) == (rule == "correlated_pool"), "a pool that is none, or none where there must be one")
    require(given.liars == 0 or pool in (None, PRIOR), "a pool that a liar may have chosen")
    size = max(given.committee, 2 * (given.quorum or 0)) + 4 * given.liars

    def draws(robots: int) -> bool:
        """Whether of so many robots a committee votes."""
        return given.committee > 0 and robots > size + size // 2

    def needs(robots: int) -> int:
        if given.quorum is not None:
            return given.quorum
        return size // 2 + 1 + given.liars if draws(robots) else min(robots + given.liars, (1 << 32) - 1) // 2 + 1

    def suffice(robots: int, counts=lambda robot: True) -> bool:
        """Whether so many of so many robots take part, and enough of them gave evidence."""
        reached, gave = (sum(counts(held["robot"]) for held in of) for of in (votes + others, votes))
        # What a robot said before it saw anything proves nothing where liars are expected.
        counting = reached if given.quorum is None and given.liars == 0 else gave
        return counting >= needs(robots) and (given.liars == 0 or gave > 2 * given.liars)

    def suffice_of(robots: int) -> bool:
        """The same of those who were drawn, or may have been by robots that know of half as many."""
        if not draws(robots):
            return suffice(robots)
        return suffice(robots, lambda robot: lot(counter, robot) < min((size << 65) // robots, WORD))

    robots = certificate["robots"]
    require(certificate["quorum"] == needs(robots), "another quorum than that of so many robots")
    # How many robots there were is its author's word.
    stated, truly = suffice(robots), suffice_of(max(robots, given.robots))
    gesture, part = decision["class"], f"{len(votes + others)} of {robots} robots"
    require(gesture is None or (stated and truly), f"too few of {max(robots, given.robots)} robots took part")
    probabilities, sure = judge(rule, [spread(vote, named) for vote in voted], given, pool) if votes else (None, 0.0)
    said = certificate["probabilities"] + ([] if certificate["unknown"] is None else [certificate["unknown"]])
    if probabilities is None:
        require(gesture is None and not votes and not said and decision["confidence"] == 0, "votes that say nothing, for something")
        return f"nothing was decided, and {part} took part"

    def close(a: float, b: float) -> bool:
        return abs(a - b) <= TOLERANCE

    places = [*range(of_list), *named]
    for held in votes:
        vote = held["vote"]
        knows_of = dict(zip([*range(of_list), *vote["named"]], vote["evidence"]))
        known = [place for place in places if place in knows_of]
        require(held["class"] == max(known, key=knows_of.get), "a vote for another gesture")
        require(close(held["weight"], weight(rule, vote["evidence"], given.clip)), "a vote of another weight")
    require(len(said) == len(probabilities), "unknown where no vote tells it, or none where one does")
    require(all(map(close, probabilities, said)), "other probabilities")
    require(close(max(probabilities), decision["confidence"]), "another confidence")
    if gesture is None:
        enough = truly or (stated and not draws(robots))
        require(not (enough and sure - TOLERANCE >= 1 - alpha), "the votes suffice for a gesture")
        return f"nothing was decided, and {part} took part"
    of_class = probabilities[places.index(gesture)]
    require(close(of_class, max(probabilities)), "another class is likelier")
    require(min(of_class, sure) + TOLERANCE >= 1 - alpha, "the votes do not suffice")
    return f"class {gesture}, p = {of_class:.3f}, by {part}"


def of_line(text: bytes) -> bytes:
    """What a line of `gestalt watch --json` says of a decision; any other text as it is."""
    begin, end = b'{"decision":', b',"event":"decision"}'
    line = text.strip(b" \t\n\r")
    return line[len(begin):-len(end)] if line.startswith(begin) and line.endswith(end) else text


def prove(decision: bytes, roster: bytes, given: argparse.Namespace) -> str:
    """What is proven by the decision that is written there; raises why none is."""
    decision, roster = DECISION(document(of_line(decision), LONGEST)), ROSTER(document(roster, LONGEST_ROSTER))
    swarm, certificate = members(roster), decision["certificate"]

    def signed(by: int, said: bytes, signature: str, what: str) -> None:
        require(str(by) in roster["robots"], f"robot {by} is no member")
        require(signature is not None, f"{what} of robot {by} is not signed")
        require(len(said) <= LONGEST_STATEMENT, f"{what} of robot {by} is longer than any")
        verify(roster["robots"][str(by)], b"gestalt-statement-1\0" + swarm + said, signature)

    signed(decision["announcer"], aloud(decision), decision["signature"], "the announcement")
    sound(decision)
    for held in certificate["votes"] + certificate["others"]:
        signed(held["robot"], statement(held), held["signature"], "the vote")
    return f"round {decision['round']['counter']}, {follows(decision, given)}"


def main() -> None:
    arguments = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    arguments.add_argument("decision", help="what stood on gestalt/<swarm>/decision, JSON, or a line of gestalt watch --json with it; - for standard input")
    arguments.add_argument("--roster", required=True, help="the swarm's roster.json")
    arguments.add_argument("--rule", default="correlated_pool", choices=list(filter(None, RULES)))
    arguments.add_argument("--alpha", type=float, help="by default that of the rule: 0.05 for the pools, 0.5 for the others")
    arguments.add_argument("--clip", type=float, default=6.0)
    arguments.add_argument("--quorum", type=int, help="so many robots that gave evidence; by default a majority of all")
    arguments.add_argument("--liars", type=int, default=0)
    arguments.add_argument("--committee", type=int, default=72, help="of more robots than half as many again, so many vote; 0: always all")
    arguments.add_argument("--robots", type=int, default=1, help="how many robots there were at least, if that is known: of how many it was is its author's word")
    given = arguments.parse_args()
    try:
        with sys.stdin.buffer if given.decision == "-" else open(given.decision, "rb") as file:
            decision = file.read(LONGEST + 1)
        with open(given.roster, "rb") as file:
            roster = file.read(LONGEST_ROSTER + 1)
        print(f"proven: {prove(decision, roster, given)}")
    except Refused as error:
        sys.exit(f"refused: {error}")
    except InvalidSignature:
        sys.exit("refused: a signature is not its author's")
    except (OSError, ValueError, OverflowError, RecursionError) as error:
        sys.exit(f"refused: no decision, or no roster: {error!r}")


if __name__ == "__main__":
    main()
