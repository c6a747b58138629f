"""A fit of five values to 10,000 rows by `lynkeus fit`, and by SciPy on the same likelihood in JAX.

usage: python python/benchmarks/fit_peers.py LYNKEUS     (the release build; needs numpy, scipy and jax)
"""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np

PLANT = """model Cascade "Four tanks, one below the other"
  parameter Real k1(min = 0.005, max = 0.6) = 0.06;
  parameter Real k2(min = 0.005, max = 0.6) = 0.05;
  parameter Real kp(min = 0.003, max = 0.3) = 0.03;
  input Real pump(start = 4, min = 0, max = 10);
  Real a(start = 5, min = 0.01, max = 40);
  Real b(start = 5, min = 0.01, max = 40);
  Real c(start = 5, min = 0.01, max = 40);
  Real d(start = 5, min = 0.01, max = 40);
  output Real level = d;
  output Real first = a;
equation
  der(a) = kp*pump - k1*sqrt(a);
  der(b) = k1*sqrt(a) - k2*sqrt(b);
  der(c) = k2*sqrt(b) - k1*sqrt(c);
  der(d) = k1*sqrt(c) - k2*sqrt(d);
end Cascade;
"""

STUDY = """plant = "plant.mo"
[sensors]
noise = { level = 0.2, first = 0.1 }
[process_noise]
a = 1e-3
d = 1e-5
[observer]
family = "ekf"
initial = { default = 5 }
initial_variance = { default = 0.01 }
[estimate]
method = "rk4"
step = 1.0
[fit]
parameters = ["k1", "k2", "kp"]
noise = ["level"]
process_noise = ["a"]
starts = 1
"""

ROWS = 10_000
#: k1, k2, kp, the noise of the level, the density of a
TRUTH = np.array([0.05, 0.06, 0.028, 0.05, 1e-4])
START = np.array([0.06, 0.05, 0.03, 0.2, 1e-3])


def log() -> tuple[np.ndarray[Any, Any], np.ndarray[Any, Any]]:
    """The pump, and readings of both levels."""
    random = np.random.default_rng(1)
    k1, k2, kp, noise, density = TRUTH
    pump = 3 + 2 * np.sign(np.sin(np.arange(ROWS) / 150))
    x = np.full(4, 5.0)
    readings = np.empty((ROWS, 2))
    spread = np.sqrt(0.25 * np.array([density, 0, 0, 1e-5]))

    def f(x: np.ndarray[Any, Any], u: float) -> np.ndarray[Any, Any]:
        s = np.sqrt(np.maximum(x, 1e-6))
        return np.array([kp * u - k1 * s[0], k1 * s[0] - k2 * s[1], k2 * s[1] - k1 * s[2], k1 * s[2] - k2 * s[3]])

    for row, u in enumerate(pump):
        readings[row] = x[3] + noise * random.normal(), x[0] + 0.1 * random.normal()
        for _ in range(4):
            x = x + 0.25 * f(x + 0.125 * f(x, u), u) + spread * random.normal(size=4)
    return pump, readings


def ours(binary: str, pump: np.ndarray[Any, Any], readings: np.ndarray[Any, Any]) -> None:
    with tempfile.TemporaryDirectory() as folder:
        at = Path(folder)
        (at / "plant.mo").write_text(PLANT)
        (at / "study.toml").write_text(STUDY)
        rows = (f"{t},{u},{y:.17g},{z:.17g}\n" for t, (u, (y, z)) in enumerate(zip(pump, readings, strict=True)))
        (at / "log.csv").write_text("t,pump,level,first\n" + "".join(rows))
        begin = time.perf_counter()
        done = subprocess.run(
            [binary, "fit", "study.toml", "log.csv", "--json"], cwd=at, capture_output=True, text=True, check=True
        )
        seconds = time.perf_counter() - begin
    answer = json.loads(done.stdout)
    found = [answer["parameters"][k]["value"] for k in ("k1", "k2", "kp")]
    found += [answer["noise"]["level"]["value"], answer["process_noise"]["a"]["value"]]
    tell("lynkeus fit, log read and standard errors included", seconds, answer["nll"], answer["evaluations"], found)


def theirs(pump: np.ndarray[Any, Any], readings: np.ndarray[Any, Any]) -> None:
    import jax
    import jax.numpy as jnp
    import scipy.optimize

    jax.config.update("jax_enable_x64", True)

    def flow(x: Any, p: Any, u: Any, theta: Any) -> tuple[Any, Any]:
        k1, k2, kp, _, density = theta

        def f(x: Any) -> Any:
            s = jnp.sqrt(x)
            return jnp.array([kp * u - k1 * s[0], k1 * s[0] - k2 * s[1], k2 * s[1] - k1 * s[2], k1 * s[2] - k2 * s[3]])

        slopes = jax.jacfwd(f)(x)
        half = slopes @ p
        return f(x), half + half.T + jnp.diag(jnp.array([density, 0.0, 0.0, 1e-5]))

    def nll(logs: Any) -> Any:
        theta = jnp.exp(logs)
        variance = jnp.array([theta[3] ** 2, 0.01])

        def sample(state: Any, row: Any) -> Any:
            x, p = state
            u, y = row
            value = 0.0
            for sensor, place in enumerate((3, 0)):
                innovation = y[sensor] - x[place]
                s = p[place, place] + variance[sensor]
                gain = p[:, place] / s
                value += 0.5 * (innovation**2 / s + jnp.log(2 * jnp.pi * s))
                x, p = x + gain * innovation, p - jnp.outer(gain, p[place])
            a = flow(x, p, u, theta)
            b = flow(x + 0.5 * a[0], p + 0.5 * a[1], u, theta)
            c = flow(x + 0.5 * b[0], p + 0.5 * b[1], u, theta)
            d = flow(x + c[0], p + c[1], u, theta)
            x, p = (z + (k1 + 2 * k2 + 2 * k3 + k4) / 6 for z, k1, k2, k3, k4 in zip((x, p), a, b, c, d, strict=True))
            return (x, 0.5 * (p + p.T)), value

        begin = (jnp.full(4, 5.0), 0.01 * jnp.eye(4))
        return jax.lax.scan(sample, begin, (jnp.asarray(pump), jnp.asarray(readings)))[1].sum()

    function = jax.jit(jax.value_and_grad(nll))
    begin = time.perf_counter()
    jax.block_until_ready(function(jnp.log(START)))
    compiled = time.perf_counter() - begin
    begin = time.perf_counter()
    found = scipy.optimize.minimize(
        lambda z: tuple(np.asarray(v) for v in function(z)), np.log(START), jac=True, method="BFGS", options={"gtol": 1e-2}
    )
    seconds = time.perf_counter() - begin
    tell("SciPy's BFGS on JAX", seconds, found.fun, found.nfev, np.exp(found.x))
    begin = time.perf_counter()
    for _ in range(10):
        jax.block_until_ready(function(found.x))
    print(f"  of which a gradient {100 * (time.perf_counter() - begin):.1f} ms; before that {compiled:.1f} s to compile")


def tell(what: str, seconds: float, nll: float, count: int, found: Any) -> None:
    values = " ".join(f"{v:.6g}" for v in found)
    print(f"{what}: {seconds:.2f} s, {count} evaluations, -log L {nll:.4f}: {values}", flush=True)


if __name__ == "__main__":
    made = log()
    lynkeus = str(Path(sys.argv[1]).resolve())
    ours(lynkeus, *made)
    theirs(*made)
    ours(lynkeus, *made)
