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
# # A measured pipe
#
# Hot water enters a steel pipe of 39 m, insulated, cold at first. Its outlet is measured; what entered, and when? The
# water needs a minute to pass, so the answer comes late or not at all, unless later readings are used: a smoother.
#
# The data were measured on the test bench of the University of Liège (van der Heijde et al., *Energy Conversion
# and Management* 151, 2017; published with the Modelica Buildings Library). They are not shipped here: the notebook looks for
# `shared/data/district-pipe` beside the repository, and says `skipped` where they are missing.

# %%
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import lynkeus

ROOT = next(f for f in (Path.cwd(), *Path.cwd().parents) if (f / "examples" / "two-tanks").is_dir())
FILE = ROOT.parent / "shared" / "data" / "district-pipe" / "ULg150801.csv"
measured = lynkeus.Log.load(str(FILE)) if FILE.exists() else None
print(f"{len(measured)} rows" if measured else "skipped: the measured data are not here")

# %% [markdown]
# ## The plant
#
# Thirty cells of water and thirty of wall, from the pipe's data sheet; nothing is fitted.

# %%
pipe = lynkeus.Model.from_modelica(
    """
model Pipe "Hot-water pipe in cells of water and wall"
  parameter Integer N = 30;
  parameter Real L = 39, d = 0.05248, D = 0.0603;
  parameter Real UA = 15400 "Water to wall, in all (W/K)";
  parameter Real pi = 3.141592653589793;
  parameter Real Cw = 1000*4186*pi/4*d^2*L/N;
  parameter Real Cs = 7800*480*pi/4*(D^2 - d^2)*L/N;
  parameter Real loss = 2*pi*0.04*L/N/log((D/2 + 0.013)/(D/2));
  input Real m_flow(start = 1, min = 0, max = 2, unit = "kg/s");
  input Real T_in(start = 17, min = 0, max = 90, unit = "degC") "Water at the inlet";
  Real T[N](each start = 17, each min = 0, each max = 90, each unit = "degC") "Water along the pipe";
  Real W[N](each start = 17, each min = 0, each max = 90, each unit = "degC") "Wall along the pipe";
  output Real T_out(unit = "degC") = T[N];
equation
  Cw*der(T[1]) = m_flow*4186*(T_in - T[1]) + UA/N*(W[1] - T[1]);
  for i in 2:N loop
    Cw*der(T[i]) = m_flow*4186*(T[i-1] - T[i]) + UA/N*(W[i] - T[i]);
  end for;
  for i in 1:N loop
    Cs*der(W[i]) = UA/N*(T[i] - W[i]) - loss*(W[i] - 18);
  end for;
end Pipe;"""
)
study = lynkeus.Study(
    pipe,
    unknown=["T_in"],
    noise={"T_out": 0.1},
    process_noise={"T": 1e-3, "W": 1e-3, "T_in": 1.0},
    observer="ekf",
    estimate={"method": "adaptive", "rtol": 1e-6, "atol": 1e-8, "smooth": True, "sd": True},
    plot={"show": ["T_in", "T[15]"], "time_unit": "s"},
)

# %% [markdown]
# ## The inlet from the outlet
#
# The filter at time t has seen nothing yet of the water that is still in the pipe; the smoother has.

# %%
if measured:
    run = study.estimate(measured)
    panels = run.plot(truth=measured)
    dots = panels[0].plot(run.t, measured.column("T_out"), ".", color="#E69F00", markersize=3)
    panels[0].legend(dots, ["outlet, measured"], frameon=False)
    plt.show()

# %% [markdown]
# The measured inlet, which the observer never sees, is the judge, from 20 s on and until 90 s before the end. Without a
# model there is the outlet, shifted by the time that the water takes (the pipe's volume over the flow); and, for fairness, shifted by the
# delay that fits the inlet best, which only someone who has measured the inlet can know: the wall holds the front back.

# %%
if measured:
    t, inlet, outlet = (measured.column(name) for name in ("t", "T_in", "T_out"))
    judged = (t > 20) & (t < t[-1] - 90)

    def rms(error):
        return float(np.sqrt(np.mean(error[judged] ** 2)))

    def shifted(lag):
        return rms(np.interp(t + lag, t, outlet) - inlet)

    passage = np.pi / 4 * 0.05248**2 * 39 * 1000 / np.median(measured.column("m_flow"))
    fitted = min(range(40, 120), key=shifted)
    found = {
        "filter, as readings come": rms(run["T_in_hat"] - inlet),
        f"outlet {passage:.0f} s later, by volume": shifted(passage),
        "smoothed": rms(run["T_in_smooth"] - inlet),
        f"outlet {fitted} s later, by the inlet": shifted(fitted),
    }
    for name, value in found.items():
        print(f"{name:<32} {value:5.2f} K")
    late, by_volume, smoothed, by_inlet = found.values()
    assert abs(smoothed - 0.93) < 0.01 and abs(by_volume - 2.84) < 0.01 and late > 5
    assert by_inlet < smoothed  # the flow is constant here: one fitted number does as well

# %% [markdown]
# So the smoother, with nothing fitted, is three times better than the delay that the pipe's volume says; and a single delay
# *fitted to the answer* is a little better still, as long as the flow does not change. The filter as readings come is useless for the
# inlet: it hears of the front a minute and a half late, and no causal method can do better.
