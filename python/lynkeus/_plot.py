"""Pictures by matplotlib, of the same panels as the command's: what is true dashed, what is
estimated solid with a band of two standard deviations, what later rows make of it in green."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import chain
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ._arguments import optional, words
from .errors import ArgumentError, InputError, LynkeusError

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from .results import Run

Column = NDArray[np.float64]

#: colours that the colour-blind tell apart (Okabe and Ito), those of the command's pictures
TRUE, ESTIMATED, SMOOTHED, PLAIN, MEASURED = "#595959", "#0072B2", "#009E73", "#CC79A7", "#E69F00"
BAND = 0.18
#: a panel is cut where its curves span more than so many times what is worth seeing
TOO_TALL = 4.0


@dataclass
class Curve:
    """A line: its words in the legend, its values, and how it looks."""

    label: str
    values: Column
    look: dict[str, Any]


@dataclass
class Panel:
    """A quantity over time; ``low`` and ``high`` are the ends of its band."""

    name: str
    caption: str
    curves: list[Curve] = field(default_factory=list)
    band: str = ""
    low: Column | None = None
    high: Column | None = None
    is_monitor: bool = False


def captions(run: Run) -> tuple[dict[str, str], str]:
    """The captions of the panels of the command's picture by name, from the top, and the label of its time."""
    try:
        told = run._core.panels()
    except LynkeusError:
        told = None  # nothing to draw for the command; a column may still be wanted
    time, panels = told or (run.columns[0], [])
    return dict(panels), time


def asked(names: Iterable[str] | None) -> list[str] | None:
    """The names to draw; a single one counts as a list of one."""
    found = optional(words)("names", names)
    if found is not None and not found:
        raise InputError("names: expected at least one quantity or column, found none")
    return None if found is None else list(found)


def of_run(run: Run, names: Sequence[str] | None, truth: Mapping[str, Column]) -> tuple[list[Panel], str]:
    """The panels of a run, those of its study's ``[plot] show`` where ``names`` says nothing, and the
    label of the time axis."""
    estimates = dict(run.summary.get("estimates", {}))
    told, time = captions(run)
    shown = [name for name in told if name in estimates or name in run.columns]
    wanted = list(names if names is not None else (shown or estimates or run.columns[1:]))
    return [_panel(run, name, estimates, told.get(name, name), truth) for name in wanted], time


def _panel(run: Run, name: str, estimates: Mapping[str, str], caption: str, truth: Mapping[str, Column]) -> Panel:
    panel = Panel(name, caption)
    if name not in estimates:
        panel.curves.append(Curve(name, run[name], {"color": PLAIN, "linewidth": 1.4}))
        panel.is_monitor = name in run.summary.get("monitors", {})
        return panel
    true = run[name] if name in run.columns else truth.get(name)
    estimate = run[estimates[name]]
    if true is not None:
        panel.curves.append(Curve("true", true, {"color": TRUE, "linestyle": "--", "zorder": 3}))
    panel.curves.append(Curve("estimated", estimate, {"color": ESTIMATED}))
    smooth, sd, smooth_sd = (_derived(run, name, estimates, kind) for kind in ("smooth", "sd", "smooth_sd"))
    if smooth is not None:
        panel.curves.append(Curve("smoothed", smooth, {"color": SMOOTHED}))
    if smooth is not None and smooth_sd is not None:
        panel.band, panel.low, panel.high = "± 2 sd, smoothed", smooth - 2 * smooth_sd, smooth + 2 * smooth_sd
    elif sd is not None:
        panel.band, panel.low, panel.high = "± 2 sd", estimate - 2 * sd, estimate + 2 * sd
    return panel


def _derived(run: Run, name: str, estimates: Mapping[str, str], kind: str) -> Column | None:
    """The column of that kind: these follow the estimates in their order, each kind whole."""
    start, count = run.columns.index(estimates[name]), len(estimates)
    for header in run.columns[start + count :: count][:3]:
        if header.startswith(f"{name}_{kind}"):
            return run[header]
    return None


def of_open_run(
    run: Run, names: Sequence[str] | None, truth: Mapping[str, Column]
) -> tuple[list[Panel], str]:
    """Variables of the plant alone, with the readings that count over them."""
    told, time = captions(run)
    errors = run.summary["errors"]
    panels = []
    for name in names if names is not None else [name for name in told if name in run.columns]:
        panel = Panel(name, told.get(name, name))
        if name in truth:
            panel.curves.append(Curve("true", truth[name], {"color": TRUE, "linestyle": "--", "zorder": 3}))
        if name in errors:
            readings = run[name] + run[errors[name]["column"]]
            panel.curves.append(Curve("measured", readings, {"color": MEASURED, "linestyle": "none", "marker": "."}))
        panel.curves.append(Curve("plant alone", run[name], {"color": ESTIMATED}))
        panels.append(panel)
    return panels, time


def of_many(run: Run, names: Sequence[str] | None) -> tuple[list[Panel], str]:
    """The errors of many runs: the band from 5 to 95 %, the mean, the largest."""
    quantities: dict[str, Any] = run.summary["quantities"]
    told, time = captions(run)
    panels = []
    for name in names if names is not None else told or quantities:
        if name not in quantities:
            raise KeyError(f"{name!r}: expected one of {', '.join(quantities)}")
        unit = quantities[name].get("unit")
        panel = Panel(name, f"error of {name}" + (f" ({unit})" if unit else ""))
        # the first three are of the quantity, then mean, quantiles and worst of its error
        mean, low, high, worst = (run[header] for header in quantities[name]["columns"][3:7])
        panel.band, panel.low, panel.high = "5–95 %", low, high
        panel.curves = [
            Curve("mean", mean, {"color": ESTIMATED}),
            Curve("largest of |error|", worst, {"color": TRUE, "linestyle": "--"}),
        ]
        panels.append(panel)
    return panels, time


def of_how_well(run: Run, names: Sequence[str] | None) -> tuple[list[Panel], str]:
    """Standard errors over the horizon."""
    panel = Panel("", "standard error")
    for name in names if names is not None else run.columns[1:]:
        panel.curves.append(Curve(name, run[name], {"marker": ".", "markersize": 4}))
    return [panel], run.columns[0]


def draw(panels: Sequence[Panel], t: Column, time: str, ax: Axes | Sequence[Axes] | None) -> list[Axes]:
    """A panel to each of the axes, which are made where there are none; all of them into one."""
    axes = _axes(len(panels), ax)
    if len(axes) == 1 and len(panels) > 1:
        for panel in panels:
            _draw(axes[0], panel, t, prefix=f"{panel.name} ")
    else:
        for place, panel in zip(axes, panels, strict=True):
            _draw(place, panel, t)
            place.set_title(panel.caption + _cut(place, panel), loc="left", fontsize="medium")
    axes[-1].set_xlabel(time)
    _legends(axes, {panel.name for panel in panels} if len(axes) > 1 else set())
    return axes


def _axes(count: int, ax: Axes | Sequence[Axes] | None) -> list[Axes]:
    if ax is None:
        from matplotlib import pyplot

        size = (8.0, 0.8 + 2.2 * count)
        _, made = pyplot.subplots(count, 1, sharex=True, squeeze=False, figsize=size, layout="constrained")
        return list(made[:, 0])
    # a sequence, or NumPy's array of them
    given: list[Axes] = list(np.ravel(np.asarray(ax, dtype=object)))
    if strangers := [each for each in given if not hasattr(each, "plot")]:
        raise ArgumentError.of("ax", "Axes of matplotlib", strangers[0])
    if len(given) not in (1, count):
        raise InputError(f"ax: expected one Axes or {count}, one for each panel, found {len(given)}")
    return given


def _draw(ax: Axes, panel: Panel, t: Column, prefix: str = "") -> None:
    own: Any = None  # of several quantities each has a colour of its own
    for curve in panel.curves:
        look = {"linewidth": 1.6, **curve.look}
        if prefix and curve.label != "true":
            look |= {"color": own, "linestyle": "-." if curve.label == "smoothed" else "-"}
        label = curve.label if curve.label == panel.name else prefix + curve.label
        (line,) = ax.plot(t, curve.values, label=label, **look)
        own = line.get_color() if curve.label != "true" else own
    if panel.low is not None and panel.high is not None:
        colour = own if prefix else ESTIMATED
        ax.fill_between(t, panel.low, panel.high, color=colour, alpha=BAND, linewidth=0, label=prefix + panel.band)
    ax.grid(True, color="#E2E2E2", linewidth=0.8)
    ax.set_axisbelow(True)
    ax.margins(x=0.01)
    ax.spines[["top", "right"]].set_visible(False)


def _cut(ax: Axes, panel: Panel) -> str:
    """Cuts the axis where an estimate peaks far beyond the rest, by the rule of the command's pictures;
    what to add to the caption then. Monitors, which may fall by decades, are seen by their logarithm."""
    if panel.is_monitor:
        low, high = _ends(panel.curves[0].values) if len(panel.curves[0].values) else (0.0, 0.0)
        if high > 1000 * low > 0:
            ax.set_yscale("log")
        return ""
    core = [_ends(curve.values, 0.0 if curve.label == "true" else 0.05) for curve in panel.curves]
    core += [_ends(values, 0.05) for values in (panel.low, panel.high) if values is not None]
    worth, whole = np.concatenate(core), np.concatenate([_ends(curve.values) for curve in panel.curves])
    if not len(whole):
        return ""
    (low, high), (least, most) = _ends(worth), _ends(whole)
    height = high - low
    if height > 0.0 and most - least > TOO_TALL * height:
        _limit(ax, max(low - height, least), min(high + height, most))
        return f"; peak {least if low - least > most - high else most:.3g}".replace("-", "−")
    if panel.low is not None:  # a band that is wider elsewhere is cut
        _limit(ax, min(low, least), max(high, most))
    return ""


def _limit(ax: Axes, bottom: float, top: float) -> None:
    air = 0.06 * (top - bottom) or 1.0
    ax.set_ylim(bottom - air, top + air)


def _ends(values: Column, share: float = 0.0) -> Column:
    """The least and the greatest finite value, but for that share at either end; empty where none is."""
    finite = np.sort(values[np.isfinite(values)])
    cut = int(share * len(finite))
    return finite[[cut, len(finite) - 1 - cut]] if len(finite) else finite


def _legends(axes: Sequence[Axes], alone: set[str]) -> None:
    """One legend above everything where all panels speak of the same, else one for each; but for what
    stands ``alone`` in a panel that has its name."""
    told = [ax.get_legend_handles_labels() for ax in axes]
    pairs = zip(chain(*(lines for lines, _ in told)), chain(*(labels for _, labels in told)), strict=True)
    every = {label: line for line, label in pairs if label not in alone}
    figure = axes[0].figure
    if len(axes) > 1 and len(every) <= 5 and figure is not None:
        figure.legend(
            list(every.values()), list(every), loc="outside upper right", ncols=len(every), frameon=False
        )
        return
    for ax, (_, labels) in zip(axes, told, strict=True):
        if labels:
            ax.legend(frameon=False, fontsize="small", ncols=1 if len(labels) < 5 else 2)
