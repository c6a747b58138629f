"""The 12-tray column with its observer (25 states) in JAX: 120 min by Runge-Kutta steps of 0.02,
5 % noise on both sensors every 0.1 min, many runs at once.

    python column.py run RUNS all      simulates them; of every row the mean, the 5 % and 95 % quantiles of truth and
                                       error, the worst error and sums of squares: what `simulate --runs` tells
    python column.py run RUNS plain    the same without quantiles
    python column.py check CSV         the largest difference of a run without noise to that table
    python column.py measure COMMAND   seconds by the clock, of processor time, peak MB of a command, as JSON
"""

import json
import os
import sys
import time

TRAYS, FEED, ALPHA, F, L, V = 12, 7, 1.65, 1.65, 4.69, 5.94
HOLDUP = [5.5] + [0.55] * 10 + [5.5]
START = [
    0.93000585, 0.88953536, 0.84223977, 0.78925097, 0.73261728, 0.67505746,
    0.61947090, 0.56837712, 0.47000139, 0.36710020, 0.27017424, 0.18748224,
]
STEP, STEPS, ROWS = 0.02, 5, 1200
THETA = 3.5
# chain of states, exponent, S on and beside the diagonal; state 12 is the feed's composition
CHAINS = [
    (range(7), 1, [1.5, 2, 4, 8, 10.5, 15.5, 17.5], [-0.5, -1.5, -2, -3, -4, -5]),
    ([11, 10, 9, 8, 7, 12], 14 / 11, [1.5, 2, 4, 8, 10.5, 15.5], [-0.5, -1.5, -2, -3, -4]),
]


def gains():
    """Of each sensor on each state of the observer: theta^(delta j) times the first column of 1/S."""
    import numpy as np

    found = np.zeros((2, TRAYS + 1))
    for k, (chain, delta, diagonal, beside) in zip(found, CHAINS):
        s = np.diag(diagonal) + np.diag(beside, 1) + np.diag(beside, -1)
        for j, (state, entry) in enumerate(zip(chain, np.linalg.inv(s)[:, 0])):
            k[state] = THETA ** (delta * (j + 1)) * entry
    return found.tolist()


def column(x, feed):
    y = [ALPHA * a / (1 + (ALPHA - 1) * a) for a in x]
    change = [V * (y[1] - x[0])]
    for i in range(1, TRAYS):
        liquid = L if i <= FEED else F + L
        if i == FEED:
            inflow = F * (feed - x[i]) + L * (x[i - 1] - x[i])
        else:
            inflow = liquid * (x[i - 1] - x[i])
        vapour = x[i] - y[i] if i == TRAYS - 1 else y[i + 1] - y[i]
        change.append(inflow + V * vapour)
    return [c / h for c, h in zip(change, HOLDUP)]


def field(x, feed, factors, k):
    plant, hat = x[:TRAYS], x[TRAYS:]
    errors = [hat[i] - factor * plant[i] for i, factor in zip((0, TRAYS - 1), factors)]
    free = column(hat[:TRAYS], hat[TRAYS]) + [0.0]
    corrected = [
        f - sum(k[s][i] * errors[s] for s in (0, 1) if k[s][i]) for i, f in enumerate(free)
    ]
    return column(plant, feed) + corrected


def step(x, feed, factors, k):
    moved = lambda slopes, h: [a + h * b for a, b in zip(x, slopes)]
    k1 = field(x, feed, factors, k)
    k2 = field(moved(k1, STEP / 2), feed, factors, k)
    k3 = field(moved(k2, STEP / 2), feed, factors, k)
    k4 = field(moved(k3, STEP), feed, factors, k)
    sums = [a + 2 * (b + c) + d for a, b, c, d in zip(k1, k2, k3, k4)]
    return moved(sums, STEP / 6)


def program(runs, noise, quantiles=False):
    """What is told of the runs after every 0.1 min; without noise their states."""
    import jax
    import jax.numpy as jnp

    jax.config.update("jax_enable_x64", True)
    k = gains()
    # what holds in the middle of an interval
    middle = (jnp.arange(ROWS) + 0.5) * STEP * STEPS
    feeds = jnp.where((middle < 20) | ((middle >= 60) & (middle < 85)), 0.75, 0.38)
    keys = jax.random.split(jax.random.key(1), runs)

    def interval(x, key, place, feed):
        deviates = jax.random.normal(jax.random.fold_in(key, place), (2,))
        factors = [1 + noise * deviates[s] for s in (0, 1)]
        return jax.lax.fori_loop(0, STEPS, lambda _, x: step(x, feed, factors, k), x)

    def advance(x, place_and_feed):
        x = jax.vmap(interval, in_axes=(0, 0, None, None))(x, keys, *place_and_feed)
        return x, (rows(x, place_and_feed[1]) if noise else jnp.stack(x))

    def rows(x, feed):
        truth = jnp.stack([*x[:TRAYS], jnp.full(runs, feed)])
        error = jnp.stack(x[TRAYS:]) - truth
        sums = truth.mean(1), error.mean(1), abs(error).max(1), (error**2).sum(1)
        places = jnp.array([0.05, 0.95])
        bands = (jnp.quantile(of, places, axis=1) for of in (truth, error) if quantiles)
        return (*sums, *bands)

    start = [jnp.full(runs, a) for a in START + [0.5] * (TRAYS + 1)]
    return jax.jit(lambda: jax.lax.scan(advance, start, (jnp.arange(ROWS), feeds)))


def run(runs, what):
    import jax
    import numpy as np

    begun = time.perf_counter()
    compiled = program(int(runs), 0.05, what == "all").lower().compile()
    made = time.perf_counter()
    _, found = jax.block_until_ready(compiled())
    print(json.dumps({
        "compile": made - begun,
        "run": time.perf_counter() - made,
        "mean error at the end": np.asarray(found[1])[-1].round(6).tolist(),
    }))


def check(table):
    """Against a run of ours without noise."""
    import numpy as np

    names = open(table).readline().strip().split(",")
    ours = np.genfromtxt(table, delimiter=",", skip_header=1)
    states = [f"x[{i + 1}]" for i in range(TRAYS)]
    wanted = states + [f"{name}_hat" for name in [*states, "Zf"]]
    places = [next(i for i, n in enumerate(names) if n.strip('"') == name) for name in wanted]
    _, found = program(1, 0.0)()
    difference = np.abs(np.asarray(found)[:, :, 0] - ours[1:, places])
    print(json.dumps({"difference": float(difference.max())}))


def measure(*command):
    begun = time.perf_counter()
    child = os.posix_spawnp(command[0], command, os.environ, file_actions=[
        (os.POSIX_SPAWN_OPEN, 1, os.devnull, os.O_WRONLY, 0)])
    _, status, used = os.wait4(child, 0)
    print(json.dumps({
        "clock": time.perf_counter() - begun,
        "processor": used.ru_utime + used.ru_stime,
        "peak": used.ru_maxrss / 1024,
        "status": os.waitstatus_to_exitcode(status),
    }))


if __name__ == "__main__":
    {"run": run, "check": check, "measure": measure}[sys.argv[1]](*sys.argv[2:])
