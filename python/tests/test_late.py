"""Readings that come later than their samples are taken, live and in a log."""

from __future__ import annotations

import pickle
import random

import lynkeus
import pytest

TANK = lynkeus.Model.from_modelica("""
model Tank
  input Real u;
  Real level(start = 2, min = -10, max = 20);
  Real q(start = 0, min = -10, max = 20);
  output Real y = level;
  output Real a = q;
equation
  der(level) = u - 0.2*level + 0.1*q;
  der(q) = 0.3*level - 0.4*q;
end Tank;""")


def study(**sensors: object) -> lynkeus.Study:
    return lynkeus.Study(
        TANK,
        noise={"y": 0.1, "a": 0.1},
        process_noise={"level": 0.01, "q": 0.01},
        observer={"family": "ekf", "initial_variance": {"default": 1}},
        sensors=sensors or None,  # type: ignore[arg-type]
    )


def rows(seed: int) -> list[tuple[float, dict[str, float]]]:
    drawn = random.Random(seed)
    made = []
    for k in range(80):
        row = {"u": 0.4 + 0.1 * drawn.random()}
        if drawn.random() < 0.7:
            row["y"] = 2 + 0.3 * drawn.random()
        if drawn.random() < 0.3:
            row["a"] = 1.5 + drawn.random()
        made.append((0.25 * k, row))
    return made


def test_shuffled_rows_give_what_they_give_in_order() -> None:
    in_order = rows(1)
    drawn = random.Random(2)
    shuffled = sorted(in_order, key=lambda row: row[0] + 2 * drawn.random())
    sorted_ = study().estimator()
    for t, row in in_order:
        sorted_.update(t, row)
    late = study().estimator(wait=2.0)
    for place, (t, row) in enumerate(shuffled):
        late.update(t, row)
        if place == 40:
            late = pickle.loads(pickle.dumps(late))
    assert late.wait == 2.0
    assert (late.time, late.estimate, late.sd) == (sorted_.time, sorted_.estimate, sorted_.sd)
    late.update(19.0, {"y": 2.1})
    assert [row["t"] for row in late.revised] == [19.0, 19.25, 19.5]
    assert late.revised[0]["estimate"].keys() == late.estimate.keys()
    before = late.estimate
    with pytest.raises(lynkeus.InputError, match="later than is waited for|no later than is waited for"):
        late.update(1.0, {"y": 2.1})
    assert late.health["too_late"] == 1
    assert late.estimate == before


def test_live_equals_the_log() -> None:
    log: dict[str, list[float | None]] = {name: [] for name in ("t", "y", "a", "u")}
    live = study(delay={"a": 0.5}).estimator()
    for t, row in rows(3):
        live.update(t, row)
        log["t"].append(t)
        for name in ("y", "a", "u"):
            log[name].append(row.get(name))
    run = study(delay={"a": 0.5}).estimate(log)
    assert len(run["t"]) == 80
    assert {name: run[f"{name}_hat"][-1] for name in ("level", "q")} == live.estimate
