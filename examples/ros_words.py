"""What an instructor's words on a ROS topic mean to a swarm, as `gestalt ros` takes them: for ros1.py and ros2_dds.py. Needs no ROS."""


import collections


class Last:
    """The last decision, which words are about: not one of an earlier round that comes late or again, nor the same one said less surely."""

    # How many rounds may be decided in another order than they were opened; how many of those that were decided are remembered.
    LATE, REMEMBERED = 2, 32

    def __init__(self):
        self.decision = None
        self._rounds = collections.deque(maxlen=self.REMEMBERED)

    def hear(self, decision):
        """Takes in a decision; says whether its gesture is news. What lacks a field is none: a KeyError or TypeError."""
        heard = {field: decision[field] for field in ("round", "class", "label", "final")}
        name = tuple(heard["round"][part] for part in ("counter", "opener", "life"))
        known = self.decision
        is_last = known is None or self._follows(name, heard)
        self._rounds.append(name)
        if not is_last:
            return False
        self.decision = heard
        return known is None or known["label"] != heard["label"] or not self._is_one(heard["round"], known["round"])

    @staticmethod
    def _is_one(this, other):
        """Whether two rounds may be two names of one: of one count, and not of one robot before and after it started again."""
        return this["counter"] == other["counter"] and (this["opener"] != other["opener"] or this["life"] == other["life"])

    def _follows(self, name, heard):
        (counter, opener, life), known = name, self.decision
        if self._is_one(heard["round"], known["round"]):
            return heard["final"] or not known["final"]
        last = known["round"]
        # A swarm that starts again counts from one.
        starts_again = life != last["life"] if opener == last["opener"] else counter + self.LATE < last["counter"]
        return counter > last["counter"] or starts_again and name not in self._rounds


def instruction(text, decision, spoken=None):
    """What to put on `gestalt/<swarm>/instructor/<name>/feedback` for the words in `text`: of the last `decision`, or, for what is withdrawn, of the
    round of which something was said last, `spoken`. Raises a ValueError with what there is to say instead.
    """
    words = text.split()
    if words == ["open"]:
        return {"say": "open"}
    if words in (["undo"], ["retract"]):
        word = {"say": "retract"}
    elif words in (["right"], ["wrong"]):
        word = {"say": words[0]}
    elif words[:1] == ["was"] and words[1:]:
        # A gesture is named by its label, of one word or several; a number in JSON would be a class.
        word = {"say": "was", "class": " ".join(words[1:])}
    else:
        raise ValueError(f"unknown word {text!r:.80}: say open, was GESTURE, right, wrong or undo")
    if word["say"] == "retract" and spoken is not None:
        return {**word, "round": spoken}
    if decision is None:
        raise ValueError("no round has been decided yet: say 'open'")
    if word["say"] in ("right", "wrong"):
        if decision["class"] is None:
            raise ValueError("no gesture was decided in that round that could be right or wrong: say 'was GESTURE'")
        word["of"] = decision["class"]
    return {**word, "round": decision["round"]}
