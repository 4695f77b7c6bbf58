"""Counts the decisions of a recording again, by every rule and quorum, without any of Gestalt's own code.

Usage: recount.py FILE.mcap QUORUM... ; prints one JSON object. With PyPI's mcap and jsonschema also checks every message.
"""

import json
import math
import struct
import sys

CLIP, RULES = 6.0, ("majority", "mean_probability", "log_pool", "confidence_weighted", "correlated_pool")
PRIOR = {"likeness": 0.5, "temperature": 1.1}


def records(data):
    at = 0
    while at + 9 <= len(data):
        opcode, length = data[at], struct.unpack_from("<Q", data, at + 1)[0]
        yield opcode, data[at + 9 : at + 9 + length]
        at += 9 + length


def text(data, at):
    length = struct.unpack_from("<I", data, at)[0]
    return data[at + 4 : at + 4 + length].decode(), at + 4 + length


def messages(path):
    """(schema name, topic, JSON) of every JSON message, in order."""
    schemas, channels = {}, {}
    for opcode, chunk in records(open(path, "rb").read()[8:]):
        if opcode != 6:
            continue
        compression, at = text(chunk, 28)
        assert compression == "", compression
        for inner, body in records(chunk[at + 8 :]):
            if inner == 3:
                schemas[struct.unpack_from("<H", body)[0]] = text(body, 2)[0]
            elif inner == 4:
                channel, schema = struct.unpack_from("<HH", body)
                topic, at = text(body, 4)
                channels[channel] = (schemas[schema], topic, text(body, at)[0])
            elif inner == 5:
                schema, topic, encoding = channels[struct.unpack_from("<H", body)[0]]
                if encoding == "json":
                    yield schema, topic, json.loads(body[22:])


def softmax(row):
    greatest = max(row)
    row = [math.exp(value - greatest) for value in row]
    return [value / sum(row) for value in row]


def decide(rule, quorum, certificate):
    votes = [vote["vote"] for vote in certificate["votes"]]
    gestures = len(certificate["probabilities"])
    assert not certificate.get("named"), "this recount knows the gestures of the list alone"
    reached = len(votes) + len(certificate["others"])
    needed, counted = (certificate["robots"] // 2 + 1, reached) if quorum == "majority" else (int(quorum), len(votes))
    if not votes or counted < needed:
        return None
    clip = lambda value: max(-CLIP, min(CLIP, value))
    tell = [vote for vote in votes if vote.get("unknown") is not None]

    def learned(vote, k):
        if vote.get("unknown") is None:
            return len(set(vote["evidence"])) > 1
        return vote["evidence"][k] != vote["unknown"]

    of = [k for k in range(gestures) if not tell or any(learned(vote, k) for vote in votes)]
    if not of:
        return None
    chosen = choose(rule, [[clip(vote["evidence"][k]) for k in of] for vote in votes], certificate)
    if chosen is None:
        return None
    top, p, leads = chosen
    if tell:
        odds = [math.log(sum(math.exp(clip(vote["evidence"][k]) - clip(vote["unknown"])) for k in of)) for vote in tell]
        odds = math.exp(sum(odds) / len(odds))
        others = gestures - len(of) + 1
        p, other = p * odds / (odds + others), 1 / (odds + others)
        # Of equals the first: a gesture that nobody was taught may stand before it.
        if other > p or other == p and any(k not in of for k in range(of[top])):
            return None
    return of[top] if leads and p >= (0.5 if rule in ("majority", "mean_probability") else 0.95) else None


def choose(rule, rows, certificate):
    """Which of the gestures, how likely among them, and whether it leads."""
    classes, parts = len(rows[0]), []
    if classes == 1:
        return 0, 1.0, True
    for row in rows:
        if rule == "majority":
            if row.count(max(row)) > 1:
                continue
            row = [float(value == max(row)) for value in row]
        elif rule == "mean_probability":
            row = softmax(row)
        elif rule == "confidence_weighted":
            p = softmax(row)
            entropy = -sum(value * math.log(value) for value in p if value > 0)
            weight = min(1.0, max(0.0, 1 - entropy / math.log(classes)))
            row = [weight * value for value in row]
        parts.append(row)
    if not parts:
        return None
    totals = [sum(part[k] for part in parts) for k in range(classes)]
    if rule == "correlated_pool":
        pool = certificate.get("pool") or PRIOR
        means = [sum(row) / classes for row in rows]
        lengths = [math.sqrt(sum((value - mean) ** 2 for value in row)) for row, mean in zip(rows, means)]
        voices = sum(lengths) ** 2 / sum(length**2 for length in lengths) if any(lengths) else 1
        totals = [total / (pool["temperature"] * (1 + (voices - 1) * pool["likeness"])) for total in totals]
    p = [value / len(parts) for value in totals] if rule in ("majority", "mean_probability") else softmax(totals)
    top = p.index(max(p))
    return top, p[top], totals[top] > max(value for k, value in enumerate(totals) if k != top)


def check(path):
    """Every message by others' programs: how many there are, and that each is as its schema says."""
    import jsonschema
    from mcap.reader import make_reader

    counts, validators = {}, {}
    with open(path, "rb") as file:
        for schema, channel, message in make_reader(file).iter_messages():
            counts[channel.topic] = counts.get(channel.topic, 0) + 1
            if schema.encoding == "jsonschema":
                if schema.id not in validators:
                    described = json.loads(schema.data)
                    jsonschema.Draft202012Validator.check_schema(described)
                    validators[schema.id] = jsonschema.Draft202012Validator(described)
                validators[schema.id].validate(json.loads(message.data))
    return counts


def main():
    path, quorums = sys.argv[1], sys.argv[2:]
    # Of several announcements of a round the one on more votes counts, then the one with more looks behind them.
    greatest, counts = {}, {}
    for schema, topic, message in messages(path):
        counts[topic] = counts.get(topic, 0) + 1
        if schema != "gestalt.Decision":
            continue
        votes = message["certificate"]["votes"]
        rank = ("class" in message, len(votes), sum(min(16, vote["vote"]["looks"]) for vote in votes))
        counter = message["round"]["counter"]
        if counter not in greatest or rank >= greatest[counter][0]:
            greatest[counter] = (rank, message["certificate"])
    outcomes = {
        f"{rule} {quorum}": {counter: decide(rule, quorum, certificate) for counter, (_, certificate) in greatest.items()}
        for rule in RULES
        for quorum in quorums
    }
    try:
        checked = check(path)
    except ImportError as error:
        print(f"not checked by other programs: {error}", file=sys.stderr)
        checked = None
    print(json.dumps({"outcomes": outcomes, "counts": counts, "checked": checked}))


main()
