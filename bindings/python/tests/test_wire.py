"""What travels, between bytes and dictionaries."""

import random
import unittest

import gestalt_swarm as g

# As in protocol/tests/golden.rs.
VOTE = bytes.fromhex("03070182010 0ac0202a1018486880802 0000c03f0000c0bf00000040 00 00".replace(" ", ""))
NULL_VOTE = bytes.fromhex("03070182 0100ac0202a1018486880800 00000000 00 00".replace(" ", ""))
NOTHING = bytes.fromhex("0307018201 01000000000000".replace(" ", ""))
HOLDING = bytes.fromhex("0307018201 07ac0202a10101010101000000400000403f0401".replace(" ", ""))


class Envelopes(unittest.TestCase):
    def test_a_golden_vote_decodes_and_encodes_to_the_same_bytes(self):
        vote = g.decode(VOTE)
        self.assertEqual(vote["author"], 7)
        self.assertEqual(vote["stamp"], {"boot": 1, "sequence": 130})
        self.assertEqual(vote["message"]["kind"], "vote")
        body = vote["message"]["body"]
        self.assertEqual(body["round"], {"counter": 300, "opener": 2, "life": 161})
        self.assertEqual((body["vocabulary"], body["evidence"], body["looks"]), (0x01020304, [1.5, -1.5], 2.0))
        for golden in (VOTE, NULL_VOTE, NOTHING, HOLDING):
            self.assertEqual(g.encode(g.decode(golden)), golden)

    def test_samples_are_spelt_out_one_by_one(self):
        sample = lambda number: {
            "id": {"author": 7, "life": 9, "number": number},
            "class": 3,
            "round": {"counter": 1, "opener": 2, "life": 161},
            "vector": {"i8": [-128, 0, 127]},
        }
        batch = {
            "author": 7,
            "stamp": {"boot": 1, "sequence": 2},
            "message": {"kind": "samples", "body": {"space": 2**63 + 1, "samples": [sample(1), sample(4)]}},
        }
        read = g.decode(g.encode(batch))
        self.assertEqual(read, {**batch, "signature": None})
        batch["message"]["body"]["samples"].reverse()
        with self.assertRaisesRegex(g.DecodeError, "out of order"):
            g.encode(batch)

    def test_what_is_no_message_raises(self):
        for payload in (b"", b"\x02" + VOTE[1:], VOTE[:-1], VOTE + b"x", b"\xff" * 40):
            with self.assertRaises(g.DecodeError):
                g.decode(payload)
        for message in ({}, {"author": -1}, {"author": object()}, {**g.decode(VOTE), "more": 1}):
            with self.assertRaises(g.DecodeError):
                g.encode(message)
        vote = g.decode(VOTE)
        vote["message"]["body"]["looks"] = float("nan")
        with self.assertRaises(g.DecodeError):
            g.encode(vote)

    def test_random_bytes_raise_and_never_abort(self):
        chance = random.Random(1)
        for _ in range(20_000):
            payload = bytearray(VOTE)
            for _ in range(chance.randrange(1, 6)):
                payload[chance.randrange(len(payload))] = chance.randrange(256)
            try:
                read = g.decode(bytes(payload[: chance.randrange(len(payload) + 1)]))
            except g.DecodeError:
                continue
            g.encode(read)

    def test_frames_come_back(self):
        header = {"nonce": 2**64 - 1, "sequence": 4, "age_us": 5, "encoding": "jpeg", "fps": 30.0, "camera": "webcam"}
        self.assertEqual(g.decode_frame_header(g.encode_frame_header(header)), header)
        taken = {"nonce": 1, "sequence": 4, "round": None}
        self.assertEqual(g.decode_frame_taken(g.encode_frame_taken(taken)), taken)
        with self.assertRaises(g.DecodeError):
            g.encode_frame_header({**header, "fps": 0.0})


class Fusion(unittest.TestCase):
    def test_log_pool_is_the_softmax_of_the_sum(self):
        import math

        fused = g.fuse("log_pool", [[1.0, -1.0], [2.0, -2.0]])
        self.assertAlmostEqual(fused.probabilities[0], 1 / (1 + math.exp(-6)), places=12)
        self.assertEqual(fused.top, 0)
        self.assertIsNone(g.fuse("log_pool", []))
        self.assertIsNone(g.fuse("majority", [[0.0, 0.0]]))

    def test_what_cannot_be_fused_raises(self):
        for rule, votes, clip in (
            ("best", [[1.0, -1.0]], 6.0),
            ("log_pool", [[1.0, -1.0], [1.0]], 6.0),
            ("log_pool", [[1.0]], 6.0),
            ("log_pool", [[1.0, float("inf")]], 6.0),
            ("log_pool", [[1.0, -1.0]], float("nan")),
        ):
            with self.assertRaises(g.GestaltError):
                g.fuse(rule, votes, clip)

    def test_casting_commutes_and_repeats_harmlessly(self):
        votes = [(1, [1.0, -1.0], (1, 1)), (1, [-3.0, 3.0], (1, 2)), (2, [0.5, -0.5], (1, 1)), (3, [], (1, 1))]
        outcomes = set()
        for seed in range(20):
            ballot = g.Ballot(["left", "right"])
            order = votes * 2
            random.Random(seed).shuffle(order)
            for robot, evidence, stamp in order:
                ballot.cast(robot, evidence, stamp=stamp)
            self.assertEqual(len(ballot), 3)
            outcomes.add(tuple(ballot.fuse().probabilities))
        self.assertEqual(len(outcomes), 1)
        self.assertEqual(ballot.fuse("majority").probabilities, [0.5, 0.5])
        for robot, evidence in ((4, [1.0]), (4, [float("nan"), 1.0])):
            with self.assertRaises(g.DataError):
                ballot.cast(robot, evidence)


if __name__ == "__main__":
    unittest.main()
