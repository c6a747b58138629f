"""Lee's example with its classical observer (8 states) in a library of Python: processor seconds
of one Runge-Kutta step, of a step in a batch of 4096, of an adaptive run, as JSON.

    python peers.py LIBRARY
"""

import json
import os
import sys
import time

os.environ["XLA_FLAGS"] = "--xla_cpu_multi_thread_eigen=false intra_op_parallelism_threads=1"
os.environ["OMP_NUM_THREADS"] = "1"

import numpy as np

START = [2.0, 1.0, 3.0, 3.5, 0.5, 0.5, 0.5, 0.5]
STEP = 1e-3
UNTIL = 20.0
TOLERANCE = 1e-8


def field(t, x, sin, exp):
    u = 2 * sin(3 * t)
    e = exp(u)
    x1, x2, x3, x4, z1, z2, z3, z4 = x
    i1, i2 = x1 - z1, x3 - z3
    a, b, c, q = u * 0.01, 1 - z1 * z1, z2 * 0.01 * e, 1 - z3 * z3
    g1 = 6 + (a + b)
    g2 = 9 + (a * a + (-1 + z2 * (-2 * z1)) - a * (a + b))
    g3 = 18 + (q + c)
    g4 = 81 + (-1 + z4 * (-2 * z3) + c * c - c * (q + c))
    return [
        x2 + 0.01 * x1 * u,
        -x1 + (1 - x1 * x1) * x2 + x3 * u,
        x4 + 0.01 * x2 * x3 * e,
        -x3 + (1 - x3 * x3) * x4 + u,
        z2 + 0.01 * z1 * u + g1 * i1,
        -z1 + b * z2 + z3 * u + g2 * i1 + u * i2,
        z4 + 0.01 * z2 * z3 * e + g3 * i2,
        -z3 + q * z4 + u + g4 * i2,
    ]


def best(run, least=0.3):
    """The least processor time of a run over some repetitions, the first not counted."""
    run()
    taken, begun = [], time.process_time()
    while time.process_time() - begun < least or len(taken) < 3:
        before = time.process_time()
        run()
        taken.append(time.process_time() - before)
    return min(taken)


def reference():
    """The state at the end, thirteen digits."""
    from scipy.integrate import solve_ivp

    f = lambda t, x: field(t, x, np.sin, np.exp)
    return solve_ivp(f, (0, UNTIL), START, method="DOP853", rtol=3e-14, atol=1e-14).y[:, -1]


def adaptive(run):
    error = float(np.max(np.abs(np.asarray(run()).ravel() - reference())))
    return {"adaptive": best(run), "error": error}


def with_numba():
    import inspect
    import math

    from numba import njit

    names = "x1, x2, x3, x4, z1, z2, z3, z4"

    # the same text, on arrays
    text = inspect.getsource(field)
    text = text.replace("(t, x, sin, exp)", "(t, x, d)").replace(f"    {names} = x\n", "".join(
        f"    {name} = x[{i}]\n" for i, name in enumerate(names.split(", "))))
    head, body = text.split("    return [\n")
    lines = [line.strip().rstrip(",") for line in body.strip().splitlines() if line.strip() != "]"]
    text = head + "".join(f"    d[{i}] = {line}\n" for i, line in enumerate(lines))
    space = {"sin": math.sin, "exp": math.exp}
    exec(text, space)
    f = njit(space["field"])

    start = np.array(START)

    @njit
    def run(steps):
        x = start.copy()
        k1, k2, k3, k4 = np.empty(8), np.empty(8), np.empty(8), np.empty(8)
        h = STEP
        for j in range(steps):
            t = j * h
            f(t, x, k1)
            f(t + h / 2, x + h / 2 * k1, k2)
            f(t + h / 2, x + h / 2 * k2, k3)
            f(t + h, x + h * k3, k4)
            for i in range(8):
                x[i] += h / 6 * (k1[i] + 2 * (k2[i] + k3[i]) + k4[i])
        return x[0] + x[4]

    steps = 200_000
    return {"step": best(lambda: run(steps)) / steps, "end": [run(2_000_000)]}


def rk4(f, t, x, h):
    k1 = f(t, x)
    k2 = f(t + h / 2, x + h / 2 * k1)
    k3 = f(t + h / 2, x + h / 2 * k2)
    k4 = f(t + h, x + h * k3)
    return x + h / 6 * (k1 + 2 * (k2 + k3) + k4)


def with_jax():
    import jax
    import jax.numpy as jnp

    jax.config.update("jax_enable_x64", True)
    f = lambda t, x: jnp.stack(field(t, x, jnp.sin, jnp.exp))

    def run(x, steps):
        return jax.lax.fori_loop(0, steps, lambda j, x: rk4(f, j * STEP, x, STEP), x)

    steps, lanes = 100_000, 4096
    one = jax.jit(lambda x: run(x, steps))
    start = jnp.array(START)
    many = jax.jit(lambda x: run(x, 500))
    starts = jnp.tile(start[:, None], (1, lanes)).at[0].add(0.001 * jnp.arange(lanes))
    return {
        "step": best(lambda: one(start).block_until_ready()) / steps,
        "batch": best(lambda: many(starts).block_until_ready()) / (500 * lanes),
    }


def with_diffrax():
    import diffrax
    import jax
    import jax.numpy as jnp

    jax.config.update("jax_enable_x64", True)
    f = lambda t, x, _: jnp.stack(field(t, x, jnp.sin, jnp.exp))

    @jax.jit
    def run(x):
        control = diffrax.PIDController(rtol=TOLERANCE, atol=TOLERANCE)
        found = diffrax.diffeqsolve(
            diffrax.ODETerm(f), diffrax.Dopri8(), 0.0, UNTIL, 1e-3, x,
            stepsize_controller=control, max_steps=100_000,
            saveat=diffrax.SaveAt(ts=jnp.linspace(0, UNTIL, 21)),
        )
        return found.ys[-1]

    start = jnp.array(START)
    return adaptive(lambda: run(start).block_until_ready())


def with_casadi():
    import casadi as ca

    t, x = ca.SX.sym("t"), ca.SX.sym("x", 8)
    f = ca.Function("f", [t, x], [ca.vertcat(*field(t, ca.vertsplit(x), ca.sin, ca.exp))])
    step = ca.Function("step", [x, t], [rk4(f, t, x, STEP)])
    many = step.mapaccum(10_000)
    times = STEP * np.arange(10_000)
    grid = np.linspace(0, UNTIL, 21)[1:]
    problem = {"x": x, "t": t, "ode": f(t, x)}
    cvodes = ca.integrator("c", "cvodes", problem, 0, list(grid), {"abstol": TOLERANCE, "reltol": TOLERANCE})
    return {
        "step": best(lambda: many(START, times)) / len(times),
        **adaptive(lambda: np.array(cvodes(x0=START)["xf"])[:, -1]),
    }


def with_scipy():
    from scipy.integrate import solve_ivp

    f = lambda t, x: field(t, x, np.sin, np.exp)
    grid = np.linspace(0, UNTIL, 21)
    run = lambda: solve_ivp(
        f, (0, UNTIL), START, method="DOP853", rtol=TOLERANCE, atol=TOLERANCE, t_eval=grid
    )
    return adaptive(lambda: run().y[:, -1])


if __name__ == "__main__":
    print(json.dumps(globals()[f"with_{sys.argv[1]}"]()))
