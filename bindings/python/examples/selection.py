"""Which of its samples should a robot share? The source research found: the most representative one.

    python3 selection.py                 a minute
    python3 selection.py --runs 40       the figures below

Eight robots learn six gestures; of each round every robot keeps five samples and may share one. Which one, a selection rule says.
What the others get is what they learn from, beside what they saw themselves. All rules see the same rounds: printed is the mean
difference to sharing at random, within a run, with its 95 % interval.

It depends on how far frames can be trusted, 40 runs each:

                     clean frames     40 % of them broken
    k_center          +8.1 ± 1.9         -8.2 ± 2.6
    representativity  +1.2 ± 2.5         +5.0 ± 2.4

Whoever shares what is farthest from all that is known, shares what is broken; whoever shares what is in the middle of much, shares
what the others know. The source's finding is that of unreliable frames; docs/results.md measures reliable ones, and finds k-center best.
"""

import argparse
import math
import time

import numpy as np

from gestalt_swarm import SELECTION_RULES, Classifier, TrainingSet

ROBOTS, GESTURES, WIDTH, KEPT = 8, 6, 12, 5


def farthest_from_all(samples, rng):
    """A rule of one's own: the personal sample that lies farthest from the mean of all."""
    centre = np.mean([sample.vector for sample in samples], axis=0)
    personal = [sample for sample in samples if sample.part == "personal"]
    distance = lambda sample: float(np.sum((np.asarray(sample.vector) - centre) ** 2))
    return max(personal, key=distance).key if personal else None


def views(rng, centres, gesture, count, broken):
    """What a robot sees of a gesture: one view of it, which its frames resemble, but for those that are broken."""
    spread = np.where(rng.random(count) < broken, 2.5, 0.7)[:, None]
    return centres[gesture, rng.integers(0, centres.shape[1])] + spread * rng.normal(size=(count, WIDTH))


def run(rule, seed, rounds, broken):
    """Mean accuracy of single robots after so many rounds."""
    rng = np.random.default_rng(seed)
    centres = rng.normal(size=(GESTURES, 4, WIDTH)) * 1.6
    sets = [TrainingSet(capacity=1000, selection=rule, seed=seed, robot=i + 1) for i in range(ROBOTS)]
    space = Classifier(components=WIDTH)
    sample = np.concatenate([views(rng, centres, g, 40, 0.0) for g in range(GESTURES)])
    space.fit(sample, np.repeat(np.arange(GESTURES), 40))
    for number in range(1, rounds + 1):
        gesture = int(rng.integers(0, GESTURES))
        # Each robot sees the gesture from a side of its own.
        for own in sets:
            for vector in space.transform(views(rng, centres, gesture, KEPT, broken)):
                own.keep(gesture, vector, round=number)
        for own in sets:
            for shared in own.share(1, space if rule == "margin" else None):
                for other in sets:
                    if other is not own:
                        other.receive(shared.id, shared.class_, shared.vector, shared.round)
    told = np.repeat(np.arange(GESTURES), 60)
    shown = space.transform(np.concatenate([views(rng, centres, g, 60, 0.0) for g in range(GESTURES)]))
    scores = []
    for own in sets[::2]:
        vectors, classes = zip(*((sample.vector, sample.class_) for sample in own.samples))
        scores.append(Classifier(components=WIDTH).fit(vectors, classes).score(shown, told))
    return float(np.mean(scores))


def compare(rules, runs, rounds, broken):
    scores = {name: np.array([run(rule, seed, rounds, broken) for seed in range(runs)]) for name, rule in rules.items()}
    print(f"{100 * broken:.0f} % of the frames broken{'accuracy':>15} {'against random':>20}")
    for name, score in sorted(scores.items(), key=lambda item: -item[1].mean()):
        gain = 100 * (score - scores["random"])
        interval = 1.96 * gain.std(ddof=1) / math.sqrt(len(gain))
        print(f"  {name:26} {100 * score.mean():7.1f} % {gain.mean():+12.1f} ± {interval:.1f} points")


def main():
    arguments = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    arguments.add_argument("--runs", type=int, default=8)
    arguments.add_argument("--rounds", type=int, default=18)
    chosen = arguments.parse_args()
    if chosen.runs < 2:
        arguments.error("--runs: one run has no interval; choose 2 or more")
    began = time.monotonic()
    rules = {**{name: name for name in SELECTION_RULES}, "farthest_from_all (own)": farthest_from_all}
    for broken in (0.0, 0.4):
        compare(rules, chosen.runs, chosen.rounds, broken)
    print(f"{2 * chosen.runs} runs of {chosen.rounds} rounds in {time.monotonic() - began:.0f} s")


if __name__ == "__main__":
    main()
