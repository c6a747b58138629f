"""A tank whose inflow nobody measures, and a log of it."""

from __future__ import annotations

from typing import Any

import lynkeus
import numpy as np

TEXT = """
model Tank
  input Real inflow(min = 0, max = 5);
  Real level(start = 4, min = 0.1, max = 10);
  output Real y = level;
equation
  der(level) = inflow - 0.5*sqrt(level);
end Tank;
"""
MODEL = lynkeus.Model.from_modelica(TEXT)
SIMULATE = {"until": 20, "output_step": 0.5, "inputs": {"inflow": 1.2}}


def tank(**sections: Any) -> lynkeus.Study:
    return lynkeus.Study(MODEL, unknown=["inflow"], **{"observer": {"theta": 2.0}, **sections})


def log(rows: int = 50, step: float = 0.25) -> dict[str, Any]:
    """Times in seconds and levels."""
    t = np.arange(rows) * step
    return {"t": t, "y": 4.0 + 0.5 * np.sin(0.3 * t)}


def estimated(data: Any, **sections: Any) -> lynkeus.Estimation:
    return tank(**sections).estimate(data)


def same(a: lynkeus.Estimation, b: lynkeus.Estimation) -> bool:
    """To the bit."""
    return a.columns == b.columns and all(np.array_equal(a[n], b[n], equal_nan=True) for n in a.columns)
