"""An extended Kalman filter of a chain of cells (ekf.c) in a library of Python: processor seconds of a
sample (one Runge-Kutta step, one reading), and where the filter ends (x, then deviations), as JSON.

    python filters.py LIBRARY
"""

import json
import sys

from peers import best, np

STEP, INPUT, DENSITY, VARIANCE, START, SPREAD = 0.1, 0.7, 1e-6, 4e-4, 0.5, 1e-4
CELLS = (4, 8, 25)
ROWS = 10_000
# of many filters at once, each with readings of its own phase
FLEET, FLEET_ROWS, PHASE = 1_000, 50, 0.01


def readings(rows, phase=0.0):
    return 0.5 + 0.1 * np.sin(STEP * np.arange(rows) + phase)


def end(x, p):
    return [*map(float, x), *np.sqrt(np.diag(p)).tolist()]


def with_numba():
    from numba import njit

    @njit
    def field(x, dx, g):
        before = INPUT
        for i in range(len(x)):
            below = 1.0 + x[i] * 1.5
            flow = x[i] * 2.5 / below
            g[i] = 2.5 / (below * below)
            dx[i] = before - flow
            before = flow

    # P' = F P + P F' + Q, the lower triangle
    @njit
    def spread(g, p, d):
        n = len(g)
        d[0, 0] = DENSITY - 2 * g[0] * p[0, 0]
        for i in range(1, n):
            d[i, 0] = g[i - 1] * p[i - 1, 0] - (g[i] + g[0]) * p[i, 0]
            for j in range(1, i):
                d[i, j] = g[i - 1] * p[i - 1, j] + g[j - 1] * p[i, j - 1] - (g[i] + g[j]) * p[i, j]
            d[i, i] = 2 * (g[i - 1] * p[i, i - 1] - g[i] * p[i, i]) + DENSITY

    @njit
    def run(n, y):
        x, p = np.full(n, START), SPREAD * np.eye(n)
        k, s, g = np.empty((4, n)), np.empty(n), np.empty(n)
        kp, sp = np.zeros((4, n, n)), np.zeros((n, n))
        gain, last = np.empty(n), np.empty(n)
        for row in range(len(y)):
            if row > 0:
                field(x, k[0], g)
                spread(g, p, kp[0])
                for stage in range(1, 4):
                    c = STEP if stage == 3 else STEP / 2
                    for i in range(n):
                        s[i] = x[i] + c * k[stage - 1, i]
                        for j in range(i + 1):
                            sp[i, j] = p[i, j] + c * kp[stage - 1, i, j]
                    field(s, k[stage], g)
                    spread(g, sp, kp[stage])
                for i in range(n):
                    x[i] += STEP / 6 * (k[0, i] + 2 * (k[1, i] + k[2, i]) + k[3, i])
                    for j in range(i + 1):
                        p[i, j] += STEP / 6 * (kp[0, i, j] + 2 * (kp[1, i, j] + kp[2, i, j]) + kp[3, i, j])
            rest, variance = y[row] - x[n - 1], p[n - 1, n - 1] + VARIANCE
            for i in range(n):
                last[i] = p[n - 1, i]
                gain[i] = last[i] / variance
                x[i] += gain[i] * rest
            for i in range(n):
                for j in range(i + 1):
                    p[i, j] -= gain[i] * last[j]
        return x, p

    y = readings(ROWS)
    found = {}
    for n in CELLS:
        found[f"sample {n}"] = best(lambda: run(n, y)) / ROWS
        found[f"by covariance {n}"] = end(*run(n, y))
    return found


def rate(x):
    flow = 2.5 * x / (1 + 1.5 * x)
    dx = -flow
    dx[0] += INPUT
    dx[1:] += flow[:-1]
    return dx


def with_filterpy():
    """The transition that FilterPy asks for, by one step of Runge and Kutta: x, Phi and W."""
    from filterpy.kalman import ExtendedKalmanFilter

    class Chain(ExtendedKalmanFilter):
        def predict_x(self, u=0):
            self.x = self.next

    def moved(z, n):
        x, phi, w = z[0], z[1:n + 1], z[n + 1:]
        slope = 2.5 / (1 + 1.5 * x) ** 2
        f = np.diag(-slope) + np.diag(slope[:-1], -1)
        fw = f @ w
        return np.vstack((rate(x), f @ phi, fw + fw.T + DENSITY * np.eye(n)))

    def run(n, y):
        f = Chain(dim_x=n, dim_z=1)
        f.x, f.P, f.R = np.full(n, START), SPREAD * np.eye(n), np.array([[VARIANCE]])
        row = np.zeros((1, n))
        row[0, -1] = 1
        for place, reading in enumerate(y):
            if place > 0:
                z = np.vstack((f.x, np.eye(n), np.zeros((n, n))))
                k1 = moved(z, n)
                k2 = moved(z + STEP / 2 * k1, n)
                k3 = moved(z + STEP / 2 * k2, n)
                k4 = moved(z + STEP * k3, n)
                z = z + STEP / 6 * (k1 + 2 * (k2 + k3) + k4)
                f.next, f.F, f.Q = z[0], z[1:n + 1], z[n + 1:]
                f.predict()
            f.update(np.array([reading]), lambda x: row, lambda x: x[-1:])
        return f.x, f.P

    y = readings(ROWS)
    found = {}
    for n in CELLS:
        found[f"sample {n}"] = best(lambda: run(n, y[:500])) / 500
        found[f"by transition {n}"] = end(*run(n, y))
    return found


def with_jax():
    """Many filters by `vmap`: F by `jacfwd` and products of matrices, or its two bands written out."""
    import jax
    import jax.numpy as jnp

    jax.config.update("jax_enable_x64", True)

    def flows(x):
        flow = 2.5 * x / (1 + 1.5 * x)
        return jnp.concatenate([jnp.array([INPUT]), flow[:-1]]) - flow

    def by_products(x, p):
        return jax.jacfwd(flows)(x) @ p

    def by_bands(x, p):
        scaled = (2.5 / (1 + 1.5 * x) ** 2)[:, None] * p
        return jnp.concatenate([jnp.zeros((1, len(x))), scaled[:-1]]) - scaled

    def filter_of(n, product):
        def moved(z):
            x, p = z
            fp = product(x, p)
            return flows(x), fp + fp.T + DENSITY * jnp.eye(n)

        def added(z, h, k):
            return tuple(a + h * b for a, b in zip(z, k))

        def predict(z):
            k1 = moved(z)
            k2 = moved(added(z, STEP / 2, k1))
            k3 = moved(added(z, STEP / 2, k2))
            k4 = moved(added(z, STEP, k3))
            return added(z, STEP / 6, tuple(a + 2 * (b + c) + d for a, b, c, d in zip(k1, k2, k3, k4)))

        def update(z, y):
            x, p = z
            gain = p[:, -1] / (p[-1, -1] + VARIANCE)
            return x + gain * (y - x[-1]), p - jnp.outer(gain, p[-1])

        def run(y):
            start = jnp.full(n, START), SPREAD * jnp.eye(n)
            many = jax.vmap(update, in_axes=(None, 0))(start, y[0])
            sample = jax.vmap(lambda z, y: update(predict(z), y))
            return jax.lax.scan(lambda z, y: (sample(z, y), None), many, y[1:])[0]

        return jax.jit(run)

    y = jnp.array([readings(FLEET_ROWS, PHASE * m) for m in range(FLEET)]).T
    found = {}
    for n in CELLS:
        for name, product in (("fleet", by_products), ("fleet by bands", by_bands)):
            run = filter_of(n, product)
            found[f"{name} {n}"] = best(lambda: jax.block_until_ready(run(y))) / (FLEET * FLEET_ROWS)
            x, p = run(y)
            found[f"by covariance, {name} {n}"] = end(x[0], p[0]) + end(x[-1], p[-1])
    return found


if __name__ == "__main__":
    print(json.dumps(globals()[f"with_{sys.argv[1]}"]()))
