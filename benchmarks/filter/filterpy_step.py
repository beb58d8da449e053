# SPDX-FileCopyrightText: 2026 The cairn authors
# SPDX-License-Identifier: MIT
"""What a predict and an update of FilterPy's KalmanFilter take: the row "KF 6/3 constant velocity" of scripts/scoreboard filter.

Needs numpy, scipy and filterpy. The covariance it ends with is held against the same recursion written out here.
"""
import time

import numpy
from filterpy.kalman import KalmanFilter

DT, STEPS, ROUNDS = 0.1, 2000, 21


def problem():
    F = numpy.eye(6)
    F[:3, 3:] = DT * numpy.eye(3)
    Q = numpy.zeros((6, 6))  # white acceleration of density 1
    for a in range(3):
        Q[a, a], Q[a, a + 3], Q[a + 3, a], Q[a + 3, a + 3] = DT**3 / 3, DT**2 / 2, DT**2 / 2, DT
    return F, Q, numpy.eye(3, 6), numpy.eye(3)


def filterpy_run(z):
    f = KalmanFilter(dim_x=6, dim_z=3)
    f.F, f.Q, f.H, f.R = problem()
    begin = time.perf_counter()
    for each in z:
        f.predict()
        f.update(each)
    return (time.perf_counter() - begin) / len(z), f.P


def textbook(steps):
    F, Q, H, R = problem()
    P = numpy.eye(6)
    for _ in range(steps):
        P = F @ P @ F.T + Q
        P -= P @ H.T @ numpy.linalg.solve(H @ P @ H.T + R, H @ P)
    return P


measurements = numpy.random.default_rng(7).normal(size=(STEPS, 3))
runs = [filterpy_run(measurements) for _ in range(ROUNDS)]
expected = textbook(STEPS)
assert all(numpy.allclose(P, expected, rtol=1e-9) for _, P in runs), "FilterPy's covariance is another"
print(f"FilterPy: {1e9 * numpy.median([seconds for seconds, _ in runs]):.0f} ns a step, median of {ROUNDS} rounds")
