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
# # A cell with its table
#
# How full is a lithium-ion cell? Its voltage says so only through a table (open-circuit voltage over state of charge) and after two
# slow voltages have settled. The table is part of the plant; the plant is a text, and the study needs no file.

# %%
import pickle

import matplotlib.pyplot as plt
import numpy as np

import lynkeus

cell = lynkeus.Model.from_modelica(
    """
model Cell "Lithium-ion cell: two RC circuits, open-circuit voltage from a table"
  parameter Real Q(unit = "A.s") = 8280 "Capacity";
  parameter Real R0(unit = "Ohm") = 0.010;
  parameter Real R1(unit = "Ohm") = 0.015, C1(unit = "F") = 2400;
  parameter Real R2(unit = "Ohm") = 0.020, C2(unit = "F") = 17000;
  parameter Real charge[11] = {0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1};
  parameter Real rest[11] = {3.00, 3.45, 3.55, 3.60, 3.63, 3.67, 3.75, 3.85, 3.95, 4.06, 4.18};
  input Real I(start = 0, min = -10, max = 10, unit = "A") "Current, positive when it discharges";
  Real soc(start = 0.9, min = 0, max = 1) "State of charge";
  Real v1(start = 0, min = -0.3, max = 0.3, unit = "V") "Fast voltage";
  Real v2(start = 0, min = -0.3, max = 0.3, unit = "V") "Slow voltage";
  output Real V(unit = "V") = Modelica.Math.Vectors.interpolate(charge, rest, soc) - v1 - v2 - R0*I "Terminals";
equation
  der(soc) = -I/Q;
  C1*der(v1) = I - v1/R1;
  C2*der(v2) = I - v2/R2;
end Cell;"""
)
study = lynkeus.Study(
    cell,
    measured=["V"],
    noise={"V": 0.002},
    process_noise={"soc": 1e-10, "v1": 1e-10, "v2": 1e-10},
    observer={
        "family": "ekf",
        "initial": {"soc": 0.5, "v1": 0, "v2": 0},
        "initial_variance": {"soc": 0.1, "v1": 1e-4, "v2": 1e-4},
    },
    simulate={
        "until": 5400,
        "output_step": 2,
        "inputs": {"I": "if mod(time, 300) < 180 then 2.2 else if mod(time, 900) < 840 then 0 else -1.5"},
        "seed": 3,
    },
    estimate={"sd": True},
    plot={"show": ["soc", "v1", "v2"], "time_unit": "s"},
)

# %% [markdown]
# The estimate starts at half full, 40 % off, and says how unsure it is.

# %%
run = study.simulate()
run.plot()
plt.show()

# %%
error, sd = run["soc_hat"] - run["soc"], run["soc_sd"]
late = run.t > 1000
print(f"state of charge: off by {abs(error[0]):.3f} after the first reading, RMS {np.sqrt(np.mean(error[late] ** 2)):.5f} after 1000 s")
inside = abs(error) < 2 * sd
print(f"inside of two standard deviations: {inside[~late].mean():.0%} of the rows before 1000 s, {inside[late].mean():.0%} after")
assert run.is_credible
assert np.sqrt(np.mean(error[late] ** 2)) < 4e-4
assert inside[late].mean() > 0.9 > inside[~late].mean()

# %% [markdown]
# On the way from the wrong start the filter is too sure of itself: it takes the table as straight, and the table has a
# kink every tenth. From then on it is as sure as it should be.
#
# Counting the current alone keeps the wrong start for ever. The table is what corrects it, where it is steep:

# %%
counted = 0.5 + run["soc"] - run["soc"][0]
assert np.allclose(counted - run["soc"], -0.4)

slope = np.diff([3.00, 3.45, 3.55, 3.60, 3.63, 3.67, 3.75, 3.85, 3.95, 4.06, 4.18]) / 0.1
fig, ax = plt.subplots(layout="constrained")
ax.step(np.linspace(0, 1, 11), [*slope, slope[-1]], where="post")
ax.set(xlabel="state of charge", ylabel="slope of the table (V)", ylim=(0, None))
plt.show()

# %% [markdown]
# How well a cell of this table *can* be known after ten minutes, at each state of charge: `how_well` computes it
# from the equations and the sensor's noise, without a run. (Standard errors of a model that is exact.)

# %%
precision = {}
for soc in (0.15, 0.35, 0.55, 0.75, 0.95):
    about = study.replace(
        process_noise=None,
        simulate={"until": 600, "output_step": 2, "initial": {"soc": soc}, "inputs": {"I": 0.2}},
    )
    precision[soc] = about.how_well().standard_error["soc"]
    print(f"at {soc:.0%}: ±{precision[soc]:.6f}")
assert max(precision, key=precision.get) == 0.35  # where the table is flat

# %% [markdown]
# ## Live, and over a restart
#
# The estimator takes readings as they come. Its pickle is all that the future depends on: here it is put away in the
# middle and goes on elsewhere, to the same bits.

# %%
log = run.log
estimator = study.estimator()
for k, (t, volts, amps) in enumerate(zip(log["t"], log["V"], log["I"], strict=True)):
    estimator.update(t, {"V": volts, "I": amps})
    if k == 1000:
        stored = pickle.dumps(estimator)
twin = pickle.loads(stored)
for t, volts, amps in list(zip(log["t"], log["V"], log["I"], strict=True))[1001:]:
    twin.update(t, {"V": volts, "I": amps})
print(len(stored), "bytes;", twin.estimate, twin.sd)
assert twin.estimate == estimator.estimate and twin.sd == estimator.sd

replayed = study.estimate(run)
assert abs(replayed["soc_hat"][-1] - estimator.estimate["soc"]) < 1e-9
