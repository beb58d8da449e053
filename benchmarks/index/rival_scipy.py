# SPDX-FileCopyrightText: 2026 The cairn authors
# SPDX-License-Identifier: MIT
"""scipy's cKDTree for rival_scipy.cpp, which starts this and talks with it over stdin and stdout.

Says "ready" once scipy is at hand. Then, until its input ends, a line asks and the answer is as long as the asker knows:

  points N     followed by N rows of three floats   nothing
  build                                             "built" and a line feed
  nearest K N  followed by N rows                   N floats, the distances of the K-th nearest
  within R N   followed by N rows                   N 32-bit integers, how many lie within R

Whoever asks takes the time: what happens here besides scipy's own work is a copy of the rows into doubles.
"""
import sys

try:
    import numpy
    from scipy.spatial import cKDTree
except ImportError:
    sys.exit(1)  # without a word, as any rival that is not installed


def main():
    asked, answers = sys.stdin.buffer, sys.stdout.buffer
    points = tree = None

    def rows(count):
        return numpy.frombuffer(asked.read(12 * int(count)), numpy.float32).reshape(-1, 3).astype(numpy.float64)

    def answer(content):
        answers.write(content)
        answers.flush()

    answer(b"ready\n")
    for line in iter(asked.readline, b""):
        command, *numbers = line.split()
        if command == b"points":
            points = rows(numbers[0])
        elif command == b"build":
            tree = cKDTree(points)
            answer(b"built\n")
        elif command == b"nearest":
            distances, _ = tree.query(rows(numbers[1]), k=[int(numbers[0])], workers=1)
            answer(distances.astype(numpy.float32).tobytes())
        elif command == b"within":
            counts = tree.query_ball_point(rows(numbers[1]), float(numbers[0]), return_length=True, workers=1)
            answer(counts.astype(numpy.int32).tobytes())
        else:
            sys.exit(f"rival_scipy.py: no such command: {line!r}")


main()
