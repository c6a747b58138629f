"""The cubature filter of the pendulum, with the process noise propagated through the flow: an
independent reference for `ukf`, by NumPy and SciPy.

    python3 pendulum_ukf.py LOG.csv > pendulum_ukf.csv

Points are drawn by Cholesky's factor; each goes through the flow; P- is their spread and
W' = FW + WF' + Q along the estimate, from W = 0. At a sample points are drawn again."""

import csv
import sys

import numpy as np
from scipy.integrate import solve_ivp

W2 = 4.0
DENSITIES = np.diag([1e-6, 1e-4, 1e-5])
NOISES = {"x": 0.02**2, "rate": 0.05**2}
TIGHT = {"rtol": 1e-12, "atol": 1e-15, "method": "DOP853"}


def flow(_, z, u):
    phi, omega, d = z
    return [omega, -W2 * np.sin(phi) - d * omega + u, 0.0]


def with_noise(t, z, u):
    phi, omega, d = z[:3]
    F = np.array([[0, 1, 0], [-W2 * np.cos(phi), -d, -omega], [0, 0, 0]])
    W = z[3:].reshape(3, 3)
    return np.concatenate([flow(t, z[:3], u), (F @ W + W @ F.T + DENSITIES).ravel()])


def carried(f, z, span, u):
    return solve_ivp(f, span, z, args=(u,), **TIGHT).y[:, -1]


def points(x, P):
    spread = np.sqrt(3.0) * np.linalg.cholesky(P).T
    return np.concatenate([x + spread, x - spread])


def main():
    rows = list(csv.DictReader(open(sys.argv[1], encoding="utf-8")))
    x, P, u, before = np.array([0.5, 0.2, 0.1]), np.diag([0.5, 0.5, 0.1]), 0.0, None
    print("t,phi_hat,omega_hat,d_hat")
    for row in rows:
        t = float(row["t"])
        if before is not None:
            images = np.array([carried(flow, p, (before, t), u) for p in points(x, P)])
            W = carried(with_noise, np.concatenate([x, np.zeros(9)]), (before, t), u)[3:]
            x = images.mean(0)
            P = (images - x).T @ (images - x) / 6.0 + W.reshape(3, 3)
        u = float(row["u"]) if row["u"] else u
        drawn = points(x, P)
        reported = [name for name in NOISES if row[name] not in ("", "nan")]
        if reported:
            shows = {"x": np.sin(drawn[:, 0]), "rate": drawn[:, 1]}
            shown = np.array([shows[name] for name in reported]).T
            mean = shown.mean(0)
            S = (shown - mean).T @ (shown - mean) / 6.0 + np.diag([NOISES[name] for name in reported])
            K = (drawn - x).T @ (shown - mean) / 6.0 @ np.linalg.inv(S)
            x = x + K @ (np.array([float(row[name]) for name in reported]) - mean)
            P = P - K @ S @ K.T
        print(f"{t:.12g}," + ",".join(f"{value:.12e}" for value in x))
        before = t


main()
