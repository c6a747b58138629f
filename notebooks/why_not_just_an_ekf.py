# ---
# jupyter:
#   jupytext:
#     formats: py:percent
#     text_representation:
#       extension: .py
#       format_name: percent
#   kernelspec:
#     display_name: Python 3
#     language: python
#     name: python3
# ---

# %% [markdown]
# # Why not just an EKF?
#
# Often: just an EKF. Here is one in NumPy, in forty lines, for any plant that Lynkeus reads; beside it the families and
# filters of `compare`, on the same data. Where the EKF wins, the notebook says so. More in
# [compare.md](../docs/compare.md).

# %%
import warnings
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import lynkeus

ROOT = next(f for f in (Path.cwd(), *Path.cwd().parents) if (f / "examples" / "two-tanks").is_dir())


# %% [markdown]
# ## Forty lines of NumPy
#
# The unknown input is a state that wanders. f and h are the plant's own equations, `Model.functions()`; slopes are differences.


# %%
class Ekf:
    """x' = f(t, x, u) + w, y = h(t, x, u) + v; the last of the states is the unknown input."""

    def __init__(self, model, x0, P0, Q, R, substeps=4):
        self.plant, self.n = model.functions(), len(x0)
        self.x, self.P, self.Q, self.R = np.array(x0, float), np.diag(P0), np.diag(Q), np.diag(R)
        self.substeps, self.t = substeps, None

    def f(self, t, x):
        return np.append(self.plant.f(t, x[:-1], x[-1:]), 0.0)

    def h(self, t, x):
        return self.plant.h(t, x[:-1], x[-1:])

    def slope(self, g, t, x):
        steps = 1e-6 * np.maximum(abs(x), 1.0)
        columns = [(g(t, x + d) - g(t, x - d)) / (2 * d.sum()) for d in np.diag(steps)]
        return np.array(columns).T

    def rates(self, t, x, P):
        F = self.slope(self.f, t, x)
        return self.f(t, x), F @ P + P @ F.T + self.Q

    def predict(self, t):
        dt = (t - self.t) / self.substeps
        for _ in range(self.substeps):  # Runge and Kutta's fourth order, x and P together
            at, x, P = self.t, self.x, self.P
            k1 = self.rates(at, x, P)
            k2 = self.rates(at + dt / 2, x + dt / 2 * k1[0], P + dt / 2 * k1[1])
            k3 = self.rates(at + dt / 2, x + dt / 2 * k2[0], P + dt / 2 * k2[1])
            k4 = self.rates(at + dt, x + dt * k3[0], P + dt * k3[1])
            self.x = x + dt / 6 * (k1[0] + 2 * k2[0] + 2 * k3[0] + k4[0])
            self.P = P + dt / 6 * (k1[1] + 2 * k2[1] + 2 * k3[1] + k4[1])
            self.t += dt

    def update(self, t, y):
        if self.t is not None:
            self.predict(t)
        self.t = t
        C = self.slope(self.h, t, self.x)
        K = np.linalg.solve(C @ self.P @ C.T + self.R, C @ self.P).T
        self.x = self.x + K @ (y - self.h(t, self.x))
        I_KC = np.eye(self.n) - K @ C
        self.P = I_KC @ self.P @ I_KC.T + K @ self.R @ K.T  # Joseph's form
        return self.x


# %% [markdown]
# ## The two tanks: the EKF wins, if its density is right
#
# The log is the shipped one: the lower level every 4 s with 0.02 V of noise; the column `pump` is the truth. How fast the pump may
# wander is one number, q.

# %%
TANKS = ROOT / "examples" / "two-tanks"
log = lynkeus.Log.load(str(TANKS / "log.csv"))
t, level, pump = (log.column(name) for name in ("t", "level", "pump"))
half = slice(len(t) // 2, None)


def rms(estimate):
    return float(np.sqrt(np.mean((estimate - pump)[half] ** 2)))


def by_hand(q, substeps=4):
    # start variances as Lynkeus takes them: a quarter of each declared range
    ranges = np.array([9.95, 9.95, 10.0])
    model = lynkeus.Model.load(TANKS / "two_tanks.mo")
    ekf = Ekf(model, [3.99, 5.2, 2.0], (ranges / 4) ** 2, [0, 0, q], [0.02**2], substeps)
    return np.array([ekf.update(*row).copy() for row in zip(t, level[:, None], strict=True)])[:, 2]


study = lynkeus.Study.load(TANKS / "smoothed.toml")
own = study.estimate(TANKS / "log.csv")
hand = by_hand(2e-4)
print(f"largest difference of the pump, ours and by hand, after 100 s: {abs(own['pump_hat'] - hand)[t > 100].max():.2e} V")
assert abs(own["pump_hat"] - hand)[t > 100].max() < 1e-4

# %% [markdown]
# By hand or by Lynkeus, it is the same filter. So the question is not which code, but which observer:

# %%
proved = lynkeus.Study.load(TANKS / "study.toml")
errors = {
    "triangular, θ = 0.03, too slow": rms(
        proved.replace(observer={"theta": 0.03}).estimate(TANKS / "log.csv")["pump_hat"]
    ),
    "triangular, θ = 0.09, tune's knee": rms(proved.estimate(TANKS / "log.csv")["pump_hat"]),
    "EKF, q = 0.0156, a guess": rms(by_hand(0.0156, 2)),
    "EKF, q = 2e-4, tuned": rms(hand),
    "EKF, q = 2e-6, too sure": rms(by_hand(2e-6, 2)),
    "EKF, q = 2e-4, smoothed": rms(own["pump_smooth"]),
}
for name, value in errors.items():
    print(f"{name:<36} RMS of the pump {value:.3f} V")
slow, knee, guess, tuned, sure, smoothed = errors.values()
assert abs(tuned - 0.101) < 2e-3 and abs(slow - 0.282) < 5e-3 and abs(guess - 0.226) < 5e-3
assert smoothed < tuned < knee < sure < guess < slow

# %% [markdown]
# **Where noise rules and the density is known, the EKF wins**, by a fifth live and by far when it may smooth. With a
# density that was guessed it is worse than one tuned θ. `compare` shows the latter in one call, on a
# simulation of the same study, where the filters take the density that Lynkeus guesses:

# %%
table = proved.replace(compare={"families": ["triangular", "ekf", "ukf"]}).compare()
table

# %%
assert table["triangular"].rms.upper < table["ekf"].rms.upper

# %% [markdown]
# ## Farza's example: the EKF wins, or diverges
#
# Five states and an unknown input v in every equation, three sensors every 0.02 s with a thousandth of noise. The family
# `unknown-input` has one θ per layer. The filter has a density for each state: where the study declares none, Lynkeus lets each
# state drift by a quarter of a percent of its range in a tenth of the log. Who knows that the equations are
# exact, as they are here, declares a density for v alone.

# %%
FARZA = ROOT / "examples" / "farza"
START = {"x1": 1, "x2": 1, "x3": 1, "x4": 0, "x5": 0, "v": -1}
noisy = lynkeus.Study.load(FARZA / "study-noise.toml").replace(estimate={"between_samples": "linear"})
plain = noisy.replace(observer=None).replace(observer={"family": "ekf", "initial": START})
DENSITIES = (2, 9, 100)
with warnings.catch_warnings():
    warnings.simplefilter("ignore", lynkeus.NotCredible)
    runs = {"unknown-input, θ = (60, 15)": noisy.simulate(), "EKF, states may drift": plain.simulate()}
    for v in DENSITIES:
        runs[f"EKF, density of v alone, {v}"] = plain.replace(process_noise={"v": v}).simulate()


def late(estimate, truth, t):
    return float(np.sqrt(np.mean((estimate - truth)[t > 5] ** 2)))


off = [late(run["x4_hat"], run["x4"], run.t) for run in runs.values()]
for (name, run), error in zip(runs.items(), off, strict=True):
    far = abs(run["x4_hat"] - run["x4"]).max()
    print(f"{name:<28} x4: RMS in the last half {error:8.4f}, at most {far:7.2f}; credible: {run.is_credible}")
family, drifting, *alone = off
assert drifting < 0.1 * family  # the EKF wins by more than ten
assert min(alone) > 10 and not any(run.is_credible for run in list(runs.values())[2:])  # or is lost

# %% [markdown]
# The same by hand, from the same samples, so that nobody has to take our filter's word: with a drift of the states it converges, without it
# the numbers run away.

# %%
reference = runs["EKF, states may drift"]
samples = reference.log
readings = np.column_stack([samples[name] for name in ("y1", "y2", "y3")])
ranges = np.array([24, 24, 10, 8, 40, 12.0])
drift = [*(ranges[:5] / 400) ** 2, 9.0]


def farza_by_hand(Q):
    ekf = Ekf(noisy.model, list(START.values()), (ranges / 4) ** 2, Q, [1e-6, 1e-6, 1e-7])
    with np.errstate(all="ignore"):
        x4 = [ekf.update(*row)[3] for row in zip(samples["t"], readings, strict=True)]
    return late(np.array(x4), reference["x4"], samples["t"])


converged, lost = farza_by_hand(drift), farza_by_hand([0, 0, 0, 0, 0, 9.0])
print(f"by hand, states may drift: {converged:.4f}; density of v alone: {lost}")
assert converged < 0.1 * family
assert not lost < 1  # not a number, or far off

# %% [markdown]
# Nothing said beforehand which of the two it would be. Its first seconds, true values dashed:

# %%
fig, axes = plt.subplots(3, 1, figsize=(8, 6), sharex=True, layout="constrained")
for ax, name in zip(axes, ("unknown-input, θ = (60, 15)", "EKF, states may drift", "EKF, density of v alone, 9"), strict=True):
    runs[name].plot(ax, ["x4"])
    ax.set_title(name, loc="left")
    ax.set(xlim=(0, 5), ylim=(-8, 8))
    ax.label_outer()
plt.show()

# %% [markdown]
# ## What no table of errors shows
#
# Of a family's observer it may be *proved* that it converges from every start on the declared box: here the
# distillation column, unknown feed included, at a rate of 0.1 per minute. Of an EKF
# nothing is proved, ours included: its gain depends on the run.

# %%
certificate = lynkeus.Study.load(ROOT / "examples" / "column" / "study-certified.toml").certify()
certificate

# %%
assert certificate.verdict == "proved" and certificate.certificate.rate == 0.1
assert study.certify().verdict == "undecided"

# %% [markdown]
# So: where noise rules and the densities are known, take the filter. Where it must not fail from any start, or what you do not know may do
# anything, take a family with a theorem, and certify it. Where both run, `compare` costs one call.
