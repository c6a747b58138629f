"""Pictures by matplotlib: the panels of the command's picture, with what is in the columns."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tank_study import estimated, log

import lynkeus

matplotlib = pytest.importorskip("matplotlib")
matplotlib.use("Agg")


@pytest.fixture(autouse=True)
def closed() -> Iterator[None]:
    yield
    from matplotlib import pyplot

    pyplot.close("all")


@pytest.fixture(scope="module")
def tanks(examples: Path) -> lynkeus.Study:
    return lynkeus.Study.load(examples / "two-tanks" / "smoothed.toml")


def lines(ax: Any) -> dict[str, Any]:
    return {line.get_label(): line for line in ax.get_lines()}


def test_a_panel_for_each_quantity_shown(tanks: lynkeus.Study) -> None:
    run = tanks.simulate()
    axes = run.plot()
    titles = [ax.get_title(loc="left") for ax in axes]
    assert [title.partition(":")[0] for title in titles] == ["pump", "upper", "lower"]
    assert all(title.endswith("(V)") for title in titles)
    assert axes[-1].get_xlabel() == "time (s)"
    drawn = lines(axes[0])
    assert drawn["true"].get_linestyle() == "--" and drawn["estimated"].get_linestyle() == "-"
    for label, header in (("true", "pump"), ("estimated", "pump_hat"), ("smoothed", "pump_smooth")):
        np.testing.assert_array_equal(drawn[label].get_ydata(), run[header])
    (band,) = axes[0].collections
    ends = band.get_paths()[0].vertices[:, 1]
    assert ends.max() == (run["pump_smooth"] + 2 * run["pump_smooth_sd"]).max()


def test_truth_from_a_log(tanks: lynkeus.Study, examples: Path) -> None:
    log = examples / "two-tanks" / "log.csv"
    run = tanks.estimate(log)
    assert "true" not in lines(run.plot()[0])
    drawn = lines(run.plot(truth=log)[0])
    np.testing.assert_array_equal(drawn["true"].get_ydata(), lynkeus.Log.load(str(log)).column("pump"))
    with pytest.raises(lynkeus.InputError, match="expected 1001 rows"):
        run.plot(truth={"t": [0.0], "pump": [1.0]})


def test_into_axes_of_the_user(tanks: lynkeus.Study) -> None:
    from matplotlib import pyplot

    run = tanks.simulate()
    _, ax = pyplot.subplots()
    assert run.plot(ax, ["upper", "lower_hat"]) == [ax]
    assert "upper estimated" in lines(ax) and "lower_hat lower_hat" not in lines(ax)
    np.testing.assert_array_equal(lines(ax)["lower_hat"].get_ydata(), run["lower_hat"])
    _, two = pyplot.subplots(2)
    assert run.plot(two, ["upper", "lower"]) == list(two)
    with pytest.raises(lynkeus.InputError, match="expected one Axes or 3"):
        run.plot(two)
    with pytest.raises(KeyError, match="expected one of t, upper"):
        run.plot(names=["nix"])


def test_a_peak_does_not_hide_the_rest(examples: Path) -> None:
    run = lynkeus.Study.load(examples / "column" / "study-peaking.toml").simulate()
    feed = run.plot(names=["Zf"])[0]
    assert f"peak −{-run['Zf_hat'].min():.3g}" in feed.get_title(loc="left")
    assert feed.get_ylim()[0] > -1


def test_arrays_and_monitors_have_their_captions(examples: Path) -> None:
    column = lynkeus.Study.load(examples / "column" / "study.toml").simulate().plot()
    names = [ax.get_title(loc="left").partition(":")[0] for ax in column]
    assert names == ["x[3]", "x[8]", "Zf", "x[10]"]
    excited = lynkeus.Study.load(examples / "ltaief" / "study-frozen.toml").simulate().plot()
    assert excited[-1].get_title(loc="left").startswith("excitation (alarm below")


def test_many_runs_and_precision(tanks: lynkeus.Study) -> None:
    many = tanks.simulate(runs=3)
    panel = many.plot()[0]
    assert panel.get_title(loc="left").startswith("error of pump (V)")
    np.testing.assert_array_equal(lines(panel)["mean"].get_ydata(), many["pump_error_mean"])
    precision = tanks.how_well()
    (ax,) = precision.plot()
    assert set(lines(ax)) == {"upper", "lower", "pump"} and ax.get_xscale() == "log"


def test_the_truth_may_lie_in_any_order_beside_texts() -> None:
    run = estimated(log())
    order = np.random.default_rng(3).permutation(len(run))
    truth = {"t": run.t[order], "level": log()["y"][order], "note": ["a"] * len(run)}
    np.testing.assert_array_equal(run._truth(truth)["level"], log()["y"])
