"""What an instructor's words on a ROS topic mean to a swarm, as `gestalt ros` takes them: for ros1.py and ros2_dds.py. Needs no ROS."""


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
