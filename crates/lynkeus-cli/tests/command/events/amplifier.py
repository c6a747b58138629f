"""The differentiating amplifier of `events/suites.rs`: an independent reference by NumPy and SciPy.

    python3 amplifier.py > amplifier.csv

From corner to corner of the source, and from one limit of the amplifier to the other, each found by bisection of the
integrator's own polynomial; within a piece the equations are smooth."""

import numpy as np
from scipy.integrate import solve_ivp

RC = 3.183098861837907e-5 * 1000.0
GAIN, LIMIT = 15000.0, 15.0
EDGE = LIMIT / GAIN
END, STEP = 0.304, 0.008


def source(t: float, begun: float) -> float:
    after = t - begun
    if after < 0.02:
        return -5.0 + 10.0 * after / 0.02
    if after < 0.05:
        return 5.0
    if after < 0.07:
        return 5.0 - 10.0 * (after - 0.05) / 0.02
    return -5.0


def main() -> None:
    rows = np.round(np.arange(0.0, END + STEP / 2, STEP), 10)
    corners = [c for k in range(-1, 5) for c in (-0.035 + 0.1 * k + d for d in (0.0, 0.02, 0.05, 0.07))]
    corners = sorted(c for c in corners if 0.0 < c < END) + [END]
    found = {0.0: 0.0}
    t, v = 0.0, 0.0
    for corner in corners:
        middle = 0.5 * (t + corner)
        begun = -0.035 + 0.1 * np.floor((middle + 0.035) / 0.1)
        while t < corner:
            own = source(t, begun) - v
            # within a piece source and output are straight lines of t and v
            side = 0 if abs(own) < EDGE else np.sign(own)

            def rate(at: float, x: list[float]) -> list[float]:
                node = source(at, begun) - x[0]
                out = -GAIN * node if side == 0 else -LIMIT * side
                return [-(out - node) / RC]

            def edge(at: float, x: list[float], which: float) -> float:
                return source(at, begun) - x[0] - which * EDGE

            edges = [lambda at, x, which=which: edge(at, x, which) for which in (-1.0, 1.0)]
            for event in edges:
                event.terminal = True
            wanted = [row for row in rows if t < row <= corner]
            done = solve_ivp(
                rate, (t, corner), [v], "Radau", events=edges, dense_output=True, rtol=1e-12, atol=1e-13
            )
            found |= {row: done.sol(row)[0] for row in wanted if row <= done.t[-1]}
            t, v = done.t[-1], done.y[0, -1]
            if t < corner:
                # across the edge
                v += rate(t, [v])[0] * 1e-13
                t += 1e-13
        t = corner
    print("t,v")
    for row in rows:
        print(f"{row:.3f},{found[row]:.9f}")


main()
