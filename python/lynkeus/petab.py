"""PEtab problems, version 1, as a study, logs and a fit: ``pip install 'lynkeus[petab]'``.

    import lynkeus.petab

    problem = lynkeus.petab.load("Boehm_JProteomeRes2014.yaml")
    problem.nll()                       # PEtab's negative log-likelihood at the nominal values
    fit = problem.fit()
    problem.values(fit)                 # by PEtab's names
    problem.write("boehm")              # plant.mo, study.toml and logs for `lynkeus fit`

The last is ``python -m lynkeus.petab Boehm_JProteomeRes2014.yaml -o boehm`` as well. ``docs/fit.md`` says what of PEtab
and SBML is read.
"""

from __future__ import annotations

import argparse
import csv
import math
import os
import sys
import warnings
from collections.abc import Mapping
from pathlib import Path
from typing import Any, cast

import numpy as np

from ._lynkeus import MEMORY
from ._petab_plant import Plant, jacobian
from ._petab_sbml import Sbml
from ._petab_tables import Parameter, Prior, Tables
from ._progress import Progress
from .errors import InputError, LynkeusError
from .model import Model
from .results import Fit
from .sections import EstimateSection, FitPriors, FitSection
from .study import Study

#: the relative tolerance at which −log L and simulations are computed
_TOLERANCE = 1e-13

__all__ = ["Parameter", "Prior", "Problem", "load", "main"]


class Problem:
    """A PEtab problem in Lynkeus' terms; :func:`load` reads one.

    Attributes
    ----------
    study : Study
        The plant, its sensors with their noises, and ``[fit]``.
    logs : list of dict
        Columns by their names, one log for each condition.
    conditions : list of str
        The conditions of these logs; after that of the steady state in which one begins.
    parameters : dict of str to Parameter
        The table of parameters, by id.
    outputs : dict of str to str
        The observable that each output of the plant is: one with several scalings, noises or replicates is several.
    constant : float
        What PEtab's negative log-likelihood has beside that of the study: Σ log m of the measurements m whose noise
        is on a logarithm.
    notes : list of str
        What of the problem is left out, or is not exact.
    """

    def __init__(self, tables: Tables, plant: Plant) -> None:
        self._plant = plant
        noise, named = plant.noise()
        model = Model.from_modelica(plant.text())
        fit: FitSection = {
            "objective": "simulation",
            "parameters": [one.name for one in plant.fitted.values()],
        }
        logs = [one.name for one in plant.fitted.values() if one.own.scale != "lin" and not one.is_power]
        if logs:
            fit["log"] = logs
        if named:
            fit["noise"] = cast(Any, named)
        priors = {one.name: cast(FitPriors, one.prior) for one in plant.fitted.values() if one.prior}
        if priors:
            fit["priors"] = priors
        # a steady state is as far away as steps of Runge and Kutta do not reach
        estimate: EstimateSection | None = {"method": "stiff"} if plant.settles else None
        self.study = Study(
            model, noise=noise or None, observer={"family": "ekf"}, fit=fit, estimate=estimate
        )
        self.logs: list[dict[str, np.ndarray[Any, Any]]] = [plant.table(i) for i in range(len(plant.logs))]
        self.conditions: list[str] = [" ".join(filter(None, log)) for log in plant.logs]
        self.parameters: dict[str, Parameter] = dict(tables.parameters)
        self.outputs: dict[str, str] = {one.name: one.observable for one in plant.channels}
        self.constant: float = math.fsum(
            jacobian(one.value, channel.transformation)
            for channel in plant.channels
            for one in channel.measurements
        )
        self.notes: list[str] = list(dict.fromkeys(plant.notes))

    def __repr__(self) -> str:
        fitted = len(self._plant.fitted)
        return (
            f"<Problem {self._plant.name}: {fitted} of {len(self.parameters)} parameters fitted, "
            f"{len(self.logs)} conditions, {len(self.outputs)} outputs>"
        )

    def fit(
        self,
        *,
        starts: int | None = None,
        seed: int | None = None,
        profiles: bool = False,
        progress: Progress = False,
        time_limit: float | None = None,
        memory_limit: float = MEMORY,
    ) -> Fit:
        """Fits the parameters, from their nominal values.

        Parameters
        ----------
        starts : int, optional
            So many searches: further ones from points spread over the bounds.
        seed : int, optional
            Seed of those points.
        profiles, progress, time_limit, memory_limit
            As of :meth:`Study.fit`.

        Returns
        -------
        Fit
            By the names of the study; :meth:`values` has PEtab's, :meth:`nll` PEtab's likelihood.
        """
        more: FitSection = {}
        if starts is not None:
            more["starts"] = starts
        if seed is not None:
            more["seed"] = seed
        study = self.study.replace(fit=more) if more else self.study
        return study.fit(
            self.logs, profiles=profiles, progress=progress, time_limit=time_limit, memory_limit=memory_limit
        )

    def values(self, fit: Fit | Mapping[str, float] | None = None) -> dict[str, float]:
        """All parameters by PEtab's ids, on the linear scale.

        Parameters
        ----------
        fit : Fit or mapping of str to float, optional
            What was found, or values by PEtab's ids; the nominal ones where it is left out.

        Returns
        -------
        dict of str to float
            In the order of the table.
        """
        found = {name: own.nominal for name, own in self.parameters.items()}
        for name, one in self._plant.fitted.items():
            found[name] = 10.0**one.start if one.is_power else one.start
        if isinstance(fit, Fit):
            for name, one in self._plant.fitted.items():
                value = fit.parameters[one.name].value
                found[name] = 10.0**value if one.is_power else value
        elif fit is not None:
            strange = [name for name in fit if name not in found]
            if strange:
                raise InputError(f'the problem has no parameter called "{strange[0]}"')
            found.update({name: float(value) for name, value in fit.items()})
        return found

    def nll(self, values: Fit | Mapping[str, float] | None = None) -> float:
        """PEtab's negative log-likelihood, with its constants, without priors.

        Parameters
        ----------
        values : Fit or mapping of str to float, optional
            A fit, whose end counts, or values by PEtab's ids, the nominal ones for what is left out.

        Returns
        -------
        float
            −log L; infinite where the model has no value.
        """
        if isinstance(values, Fit):
            found = values.nll
        else:
            found = self._still(values).nll_at_start
        return math.inf if found is None else found + self.constant

    def simulations(self, values: Fit | Mapping[str, float] | None = None) -> np.ndarray[Any, Any]:
        """What the model has in the place of the measurements, row by row of their table.

        Parameters
        ----------
        values : Fit or mapping of str to float, optional
            As of :meth:`nll`.

        Returns
        -------
        array
            In the units of the measurements.
        """
        run = values if isinstance(values, Fit) else self._still(values)
        plant = self._plant
        found = np.full(len(plant.tables.measurements), math.nan)
        logs = run["log"] if "log" in run.columns else np.ones(len(run["t"]))
        for channel in plant.channels:
            off = run[f"{channel.name}_innovation"]
            rows = {(int(log) - 1, float(t)): row for row, (log, t) in enumerate(zip(logs, run["t"], strict=True))}
            for one in channel.measurements:
                place, at = plant.places[one.log], plant.instant(one)
                row, read = rows[place, at], self.logs[place]
                reading = read[channel.name][np.searchsorted(read["t"], at)]
                value = reading - off[row]
                match channel.transformation:
                    case "log":
                        value = math.exp(value)
                    case "log10":
                        value = 10.0**value
                found[one.row] = value
        return found

    def at(self, values: Mapping[str, float]) -> Study:
        """The study with other values of parameters, where a search then starts.

        Parameters
        ----------
        values : mapping of str to float
            By PEtab's ids, on the linear scale.

        Returns
        -------
        Study
            Another study.
        """
        given: dict[str, float] = {}
        for name, value in self.values(values).items():
            one = self._plant.fitted.get(name)
            if one is not None:
                given[one.name] = math.log10(value) if one.is_power else value
            elif value != self.parameters[name].nominal:
                what = f"{name} is not estimated: its value is part of the equations"
                raise InputError(f"{self._plant.tables.path}: {what}")
        return self.study.replace(parameters=given)

    def _still(self, values: Mapping[str, float] | None) -> Fit:
        """A fit that has nowhere to go, by short steps."""
        study = self.study if values is None else self.at(values)
        given = self.values(values)
        name, one = next(iter(self._plant.fitted.items()))
        value = math.log10(given[name]) if one.is_power else given[name]
        ends = [value, value + 1e-12 * (abs(value) or 1.0)]
        fixed: FitSection = {
            "parameters": [one.name],
            "log": None,
            "priors": None,
            "bounds": {one.name: ends},
            "starts": 1,
        }
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            return study.replace(fit=fixed, estimate={"rtol": _TOLERANCE}).fit(self.logs)

    def write(self, folder: str | os.PathLike[str]) -> list[Path]:
        """Writes ``plant.mo``, ``study.toml`` and a log for each condition.

        Parameters
        ----------
        folder : path
            Where; made where it is not there.

        Returns
        -------
        list of Path
            What was written: the plant, the study, the logs.
        """
        into = Path(folder)
        into.mkdir(parents=True, exist_ok=True)
        written = [into / "plant.mo", into / "study.toml"]
        written[0].write_text(self._plant.text(), encoding="utf-8")
        written[1].write_text('plant = "plant.mo"\n' + self.study.text, encoding="utf-8")
        digits = len(str(len(self.logs)))
        for place, log in enumerate(self.logs, 1):
            path = into / f"log{place:0{digits}}.csv"
            with path.open("w", newline="", encoding="utf-8") as file:
                writer = csv.writer(file)
                writer.writerow(log)
                for row in zip(*log.values(), strict=True):
                    writer.writerow(["" if math.isnan(x) else repr(float(x)) for x in row])
            written.append(path)
        return written


def load(path: str | os.PathLike[str]) -> Problem:
    """A PEtab problem, version 1, with its model in SBML.

    Parameters
    ----------
    path : path
        The problem's YAML file.

    Returns
    -------
    Problem
        Its study, its logs, and what there is between PEtab's terms and theirs.

    Raises
    ------
    InputError
        It cannot be read, or has what is not read: events, preequilibration, steady states, noise that is not normal.
    ImportError
        The packages petab and python-libsbml are not there.
    """
    tables = Tables(path)
    model = tables.problem.model
    document = getattr(model, "sbml_document", None)
    if document is None:
        raise InputError(f"{tables.path}: expected a model in SBML, found {type(model).__name__}")
    return Problem(tables, Plant(tables, Sbml(tables.model_file(), document)))


def main(arguments: list[str] | None = None) -> int:
    """``python -m lynkeus.petab problem.yaml -o FOLDER``.

    Parameters
    ----------
    arguments : list of str, optional
        Those of the command where left out.

    Returns
    -------
    int
        The exit code: 0, or 2 for bad input.
    """
    parser = argparse.ArgumentParser(prog="python -m lynkeus.petab", description=(load.__doc__ or "").splitlines()[0])
    parser.add_argument("problem", help="the problem's YAML file")
    parser.add_argument("-o", "--output", required=True, metavar="FOLDER", help="where plant.mo, study.toml and logs go")
    given = parser.parse_args(arguments)
    try:
        problem = load(given.problem)
        written = problem.write(given.output)
    except (LynkeusError, OSError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    for note in problem.notes:
        print(f"note: {note}", file=sys.stderr)
    logs = " ".join(str(path) for path in written[2:])
    print(f"lynkeus fit {written[1]} {logs}")
    if problem.constant:
        print(f"PEtab's negative log-likelihood is nll + {problem.constant!r}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
