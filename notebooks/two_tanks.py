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
# # Two tanks
#
# A pump fills the upper tank, which drains into the lower one. Only the lower level is measured. What did the
# pump do, and how full was the upper tank? The plant is
# [two_tanks.mo](../examples/two-tanks/two_tanks.mo), the study [smoothed.toml](../examples/two-tanks/smoothed.toml).
#
# ## The README's picture in ten lines

# %%
from pathlib import Path

import lynkeus

ROOT = next(f for f in (Path.cwd(), *Path.cwd().parents) if (f / "examples" / "two-tanks").is_dir())
TANKS = ROOT / "examples" / "two-tanks"

study = lynkeus.Study.load(TANKS / "smoothed.toml")
run = study.estimate(TANKS / "log.csv")
panels = run.plot(truth=TANKS / "log.csv")

# %% [markdown]
# True values are dashed where the log has them: the observer does not read the column `pump`, so it is a judge.
# The blue line is the estimate as the readings come, with two standard deviations; the green line is what later
# readings make of it. `run.to_svg()` is the picture that `lynkeus estimate --plot` writes, to the byte.

# %%
pump = lynkeus.Log.load(str(TANKS / "log.csv")).column("pump")
half = slice(len(run) // 2, None)


def rms(error):
    return float((error[half] ** 2).mean() ** 0.5)


print(f"error of the pump: {rms(run['pump_hat'] - pump):.4f} V live, {rms(run['pump_smooth'] - pump):.4f} V smoothed")
assert abs(rms(run["pump_hat"] - pump) - 0.1014) < 1e-3
assert abs(rms(run["pump_smooth"] - pump) - 0.0268) < 1e-3
assert abs(run.errors.pump.rms_last_half - rms(run["pump_hat"] - pump)) < 1e-3
assert run.is_credible

# %% [markdown]
# ## What can be known, and why
#
# `check` decides that the pump and the upper level can be known from the lower level, everywhere on the declared
# box, and names the observers that fit. With [study.toml](../examples/two-tanks/study.toml) it is the
# `triangular` family, whose every condition is proved.

# %%
proved = lynkeus.Study.load(TANKS / "study.toml")
check = proved.check()
check

# %%
assert check.recommended == "triangular"
assert all(c.verdict == "proved" for c in check.families[0].checks)
assert {q.known for q in check.knowledge[0].quantities.values()} == {"everywhere"}

# %% [markdown]
# ## One number to tune
#
# θ sets the pace: faster follows the pump sooner and passes more noise. `tune` sweeps it and finds the knee.

# %%
sweep = proved.tune()
sweep

# %%
best = sweep.knee["keys"].theta
tuned, slow = (proved.replace(observer={"theta": theta}).simulate() for theta in (best, 0.03))
print(f"θ = {best}: RMS error of the pump {tuned.errors.pump.rms_last_half:.3f} V")
assert 0.06 < best < 0.1
assert tuned.errors.pump.rms_last_half < 0.5 * slow.errors.pump.rms_last_half

# %% [markdown]
# ## The same without files, and live
#
# A study is made of the same keys in Python. `estimator()` takes samples one by one; its pickle is its snapshot.

# %%
live = lynkeus.Study(
    lynkeus.Model.load(TANKS / "two_tanks.mo"),
    measured=["level"],
    unknown=["pump"],
    noise={"level": 0.02},
    process_noise={"pump": 2e-4},
    observer="ekf",
).estimator()
log = lynkeus.Log.load(str(TANKS / "log.csv"))
for t, level in zip(log.column("t"), log.column("level"), strict=True):
    live.update(t, {"level": level})
print(live.time, live.estimate, live.sd)
assert all(abs(live.estimate[name] - run.final[name]) < 1e-9 for name in live.names)
