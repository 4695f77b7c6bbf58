"""How fast it is, with yardsticks in the same run: training in two threads against two processes, which share no interpreter;
predict_proba against scikit-learn's SVC. For Unix.

    pip install scikit-learn      # in the virtual environment that has gestalt_swarm
    python3 speed.py
"""

import os
import statistics
import threading
import time

import numpy as np
from sklearn.svm import SVC

from gestalt_swarm import Classifier


def samples(seed, count=3000, width=24, classes=6):
    rng = np.random.default_rng(seed)
    y = rng.integers(0, classes, count)
    return rng.normal(size=(count, width)) + 2.0 * np.eye(classes, width)[y], y


def seconds(call):
    began = time.perf_counter()
    call()
    return time.perf_counter() - began


def in_threads(count, work):
    threads = [threading.Thread(target=work, args=(i,)) for i in range(count)]
    [thread.start() for thread in threads]
    [thread.join() for thread in threads]


def in_processes(count, work):
    children = []
    for i in range(count):
        child = os.fork()
        if child == 0:
            work(i)
            os._exit(0)
        children.append(child)
    [os.waitpid(child, 0) for child in children]


def main():
    sets = [samples(seed) for seed in range(2)]

    def train(i):
        Classifier(components=24).fit(*sets[i])

    train(0)
    ways = (lambda: [train(0), train(1)], lambda: in_threads(2, train), lambda: in_processes(2, train))
    rounds = [[seconds(way) for way in ways] for _ in range(7)]
    one, two, apart = (statistics.median(times) for times in zip(*rounds))
    print(f"training twice: in one thread {one:.2f} s, in two {two:.2f} s, in two processes {apart:.2f} s:")
    print(f"  threads {one / two:.2f} times as fast as one, processes {one / apart:.2f} times")

    X, y = sets[0]
    own = Classifier(components=24).fit(X[:1500], y[:1500])
    other = SVC(probability=True, C=10, gamma="scale").fit(X[:1500], y[:1500])
    shown = X[1500:]
    pairs = [(seconds(lambda: own.predict_proba(shown)), seconds(lambda: other.predict_proba(shown))) for _ in range(21)]
    mine, theirs = (statistics.median(times) / len(shown) * 1e6 for times in zip(*pairs))
    print(f"predict_proba: {mine:.0f} µs a sample, scikit-learn's SVC {theirs:.0f} µs: {theirs / mine:.1f} times as fast")
    print(f"support vectors: {own.model.support_vectors} and {len(other.support_)}")
    print(f"right: {own.score(shown, y[1500:]):.3f} and {other.score(shown, y[1500:]):.3f}")


if __name__ == "__main__":
    main()
