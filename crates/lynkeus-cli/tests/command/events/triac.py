"""The triac of `events/suites.rs`: an independent reference by NumPy and SciPy.

    python3 triac.py > triac.csv

The two thyristors' gates, each behind a diode, and the main current are two scalar equations, one within the other,
whose sides are monotone: each is bisected (Brent), so that no condition has to be guessed. The corners of the gate's
current are ends of pieces; within a piece SciPy's Radau method goes on by itself."""

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

EXACT = {"xtol": 1e-14, "rtol": 1e-15, "maxiter": 300}
END, STEP, PERIOD, DELAY = 1e-4, 4e-6, 5e-5, 2e-5
CORNERS = (0.0, 1e-6, 6e-6, 7e-6)


def gate_current(t: float) -> float:
    if t < DELAY:
        return 0.0
    after = (t - DELAY) % PERIOD
    return float(np.interp(after, CORNERS, (0.0, 0.005, 0.005, 0.0)))


def into_gate(volt: float) -> float:
    """The current through a diode (1e-5 Ω, backwards 1e5 Ω) and the gate behind it (140 Ω, above 0.65 V 10 Ω)."""
    if volt < 0.0:
        return volt / (1e5 + 140.0)
    current = volt / (140.0 + 1e-5)
    if 140.0 * current < 0.65:
        return current
    slope = 0.04999999999999993 / 0.005
    return (volt - 0.6035714285714286) / (slope + 1e-5)


def gates(total: float, v: float) -> tuple[float, float]:
    """What a current divides into, of gates on 0 and on v."""
    bound = 1e3 + abs(v)
    at = brentq(lambda g: into_gate(g) + into_gate(g - v) - total, -bound, bound, **EXACT)
    return into_gate(at), into_gate(at - v)


def main_current(v: float, control: float) -> float:
    if v < -400.0:
        return -2.55e-5 * np.exp(min(700.0, -(v + 400.0) / 0.0296))
    if control < 1.5:
        return v / 1.5686274509803923e7
    if control < 5.0:
        a = (2.0 * control - 6.5) / 7.0
        return v / (792.1180343813395 * 2.55e-9 ** ((3.0 * a - 4.0 * a**3) / 2.0))
    return v / 0.04


def charging(gate: float, v: float, current: float) -> float:
    main = 5.0 if current > 0.006 or v > 400.0 else 0.0
    if gate < 0.00475:
        return main
    return main + (1e4 * (gate - 0.00475) if gate < 0.00575 else 10.0) * v


def slopes(t: float, x: np.ndarray) -> list[float]:
    i, one, two = x
    gate = gate_current(t)

    def excess(v: float) -> float:
        return main_current(-v, two) + gates(gate, v)[1] - main_current(v, one) - i

    v = brentq(excess, -450.0, 450.0, **EXACT)
    first, second = gates(gate, v)
    toward = [charging(first, v, main_current(v, one)), charging(second, -v, main_current(-v, two))]
    source = 30.0 * np.sin(62831.853071795864 * t)
    rate = [(c - x) / (1.87e-6 if c > x else 9.57e-6) for c, x in zip(toward, (one, two))]
    return [(v - source - 10.0 * i) / 2e-6, *rate]


def main() -> None:
    rows = np.round(np.arange(0.0, END + STEP / 2, STEP), 10)
    ends = {round(DELAY + k * PERIOD + c, 12) for k in range(3) for c in CORNERS}
    ends = sorted(e for e in ends | set(rows) if 0.0 < e <= END)
    x, t = np.zeros(3), 0.0
    print("t,i,control1,control2")
    print("0.0,0.0,0.0,0.0")
    for end in ends:
        run = solve_ivp(slopes, (t, end), x, method="Radau", rtol=1e-8, atol=[1e-11, 1e-9, 1e-9])
        assert run.success, run.message
        x, t = run.y[:, -1], end
        if t in rows:
            print(",".join(f"{value:.9g}" for value in (t, *x)))


if __name__ == "__main__":
    main()
