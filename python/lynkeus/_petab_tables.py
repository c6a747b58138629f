"""The tables of a PEtab problem (version 1): what is measured when, under which conditions."""

from __future__ import annotations

import math
import os
from collections import Counter
from dataclasses import dataclass, field
from typing import Any

from ._optional import needed
from ._petab_math import Expr, number, parsed
from .errors import InputError

#: what the table of parameters calls its scales
SCALES = ("lin", "log", "log10")


@dataclass(frozen=True)
class Prior:
    """What was known before: a distribution and its numbers."""

    kind: str
    numbers: tuple[float, ...]


@dataclass(frozen=True)
class Parameter:
    """A row of the table of parameters, on the linear scale."""

    id: str
    #: ``"lin"``, ``"log"`` or ``"log10"``
    scale: str
    lower: float
    upper: float
    nominal: float
    #: whether it is fitted
    estimate: bool
    prior: Prior | None = None

    def off_scale(self, value: float) -> float:
        """Of a value on its scale the linear one."""
        match self.scale:
            case "log":
                return math.exp(value)
            case "log10":
                return math.pow(10.0, value)
        return value


@dataclass(frozen=True)
class Observable:
    """A row of the table of observables."""

    id: str
    formula: Expr
    noise: Expr
    #: ``"lin"``, ``"log"`` or ``"log10"``: of what the noise is added to
    transformation: str


@dataclass
class Measurement:
    """A row of the table of measurements."""

    observable: str
    #: the condition in whose steady state it begins, or none, and that under which it is made
    log: tuple[str, str]
    #: infinite in a steady state
    time: float
    value: float
    #: what stands for the placeholders of its observable's formulas
    overrides: dict[str, Expr] = field(default_factory=dict)
    #: place in the table
    row: int = 0


class Tables:
    """The tables, read and checked.

    Raises
    ------
    InputError
        What is not read: noise that is not normal, names of nothing, cells that are no numbers.
    """

    def __init__(self, path: str | os.PathLike[str]) -> None:
        self.path = os.fspath(path)
        library = needed("petab.v1", "lynkeus.petab")
        try:
            self.problem: Any = library.Problem.from_yaml(self.path)
        except (OSError, ValueError, KeyError, TypeError, NotImplementedError) as error:
            raise InputError(f"{self.path}: {error}") from error
        self.parameters = {one.id: one for one in map(self._parameter, *self._rows("parameter"))}
        self.observables = {one.id: one for one in map(self._observable, *self._rows("observable"))}
        self.conditions = self._conditions()
        self.measurements = [self._measurement(i, row) for i, row in enumerate(self._records("measurement"))]
        if not self.measurements:
            raise self.refused("measurement", "there is no measurement")

    def model_file(self) -> str:
        """What messages call the model."""
        named = getattr(self.problem.model, "rel_path", None) or getattr(self.problem, "model_id", None)
        return f"{self.path}: {named}" if named else self.path

    def refused(self, table: str, what: str) -> InputError:
        """An error with the place of the table."""
        return InputError(f"{self.path}: {table} table: {what}")

    def _records(self, table: str) -> list[dict[str, Any]]:
        frame = getattr(self.problem, f"{table}_df")
        if frame is None:
            raise self.refused(table, "there is none")
        index = {frame.index.name: frame.index} if frame.index.name else {}
        columns = {**index, **{name: frame[name] for name in frame.columns}}
        names, rows = list(columns), zip(*columns.values(), strict=True)
        return [dict(zip(names, row, strict=True)) for row in rows]

    def _rows(self, table: str) -> tuple[list[str], list[dict[str, Any]]]:
        records = self._records(table)
        names = [str(record[f"{table}Id"]) for record in records]
        twice = [name for name, count in Counter(names).items() if count > 1]
        if twice:
            raise self.refused(table, f'"{twice[0]}" stands there twice')
        return names, records

    def _parameter(self, name: str, row: dict[str, Any]) -> Parameter:
        scale = word(row.get("parameterScale")) or "lin"
        if scale not in SCALES:
            raise self.refused("parameter", f'{name}: expected the scale lin, log or log10, found "{scale}"')
        estimate = real(row.get("estimate", 1)) == 1
        lower, upper = (real(row.get(key)) for key in ("lowerBound", "upperBound"))
        nominal = real(row.get("nominalValue"))
        if math.isnan(nominal):
            if not estimate:
                raise self.refused("parameter", f"{name}: it is not estimated, and has no nominalValue")
            inside = (lower * upper) ** 0.5 if scale != "lin" and lower > 0 else 0.5 * (lower + upper)
            nominal = inside
        if not math.isfinite(nominal):
            raise self.refused("parameter", f"{name}: expected a finite nominalValue, found {nominal}")
        return Parameter(name, scale, lower, upper, nominal, estimate, self._prior(name, row, estimate))

    def _prior(self, name: str, row: dict[str, Any], estimate: bool) -> Prior | None:
        kind = word(row.get("objectivePriorType"))
        text = row.get("objectivePriorParameters")
        if not kind or not estimate:
            return None
        try:
            numbers = tuple(float(x) for x in str(text).split(";"))
        except ValueError:
            numbers = ()
        if len(numbers) != 2:
            raise self.refused("parameter", f'{name}: expected two objectivePriorParameters, found "{text}"')
        return Prior(kind, numbers)

    def _observable(self, name: str, row: dict[str, Any]) -> Observable:
        place = f"{self.path}: observable {name}"
        distribution = word(row.get("noiseDistribution")) or "normal"
        transformation = word(row.get("observableTransformation")) or "lin"
        if distribution in ("log-normal", "log10-normal") and transformation == "lin":
            distribution, transformation = "normal", "log" if distribution == "log-normal" else "log10"
        if distribution != "normal":
            raise InputError(f'{place}: expected noise that is normal, found "{distribution}"')
        if transformation not in SCALES:
            raise InputError(f'{place}: expected the transformation lin, log or log10, found "{transformation}"')
        return Observable(
            name,
            parsed(row["observableFormula"], place),
            parsed(row["noiseFormula"], f"{place}, its noise"),
            transformation,
        )

    def _conditions(self) -> dict[str, dict[str, Expr]]:
        """What each condition puts in the place of quantities of the model."""
        found: dict[str, dict[str, Expr]] = {}
        for record in self._records("condition"):
            condition = str(record["conditionId"])
            found[condition] = {}
            for name, cell in record.items():
                if name in ("conditionId", "conditionName"):
                    continue
                value = self.override(cell, f"condition {condition}: {name}")
                if value is not None:
                    found[condition][name] = value
        return found

    def override(self, cell: Any, place: str) -> Expr | None:
        """A number, or a parameter of the table; a fixed one as its number. None where the cell is empty."""
        text = str(cell).strip()
        if text in ("", "nan", "NaN", "None"):
            return None
        try:
            return number(float(text))
        except ValueError:
            known = self.parameters.get(text)
            if known is not None and not known.estimate:
                return number(known.nominal)
            return parsed(text, f"{self.path}: {place}")

    def _measurement(self, i: int, row: dict[str, Any]) -> Measurement:
        name = str(row["observableId"])
        if name not in self.observables:
            raise self.refused("measurement", f'row {i + 1}: no observable is called "{name}"')
        before = word(row.get("preequilibrationConditionId"))
        condition = word(row.get("simulationConditionId"))
        for one in (before or condition, condition):
            if one not in self.conditions:
                raise self.refused("measurement", f'row {i + 1}: no condition is called "{one}"')
        time, value = real(row["time"]), real(row["measurement"])
        if not time >= 0:
            raise self.refused("measurement", f"row {i + 1}: expected a time from 0 on, found {time}")
        transformation = self.observables[name].transformation
        if transformation != "lin" and value <= 0:
            what = f"row {i + 1}: {value} has no logarithm, on which {name} has its noise"
            raise self.refused("measurement", what)
        overrides: dict[str, Expr] = {}
        for kind in ("observable", "noise"):
            for k, cell in enumerate(cells(row.get(f"{kind}Parameters"))):
                own = self.override(cell, f"row {i + 1}")
                if own is not None:
                    overrides[f"{kind}Parameter{k + 1}_{name}"] = own
        return Measurement(name, (before, condition), time, value, overrides, i)


def word(cell: Any) -> str:
    """A cell as text; empty where it says nothing."""
    text = "" if cell is None else str(cell).strip()
    return "" if text in ("nan", "NaN", "None") else text


def real(cell: Any) -> float:
    """A cell as a number; NaN where it is none."""
    try:
        return float(cell)
    except (TypeError, ValueError):
        return math.nan


def cells(cell: Any) -> list[str]:
    """The parts of a cell that holds several."""
    text = word(cell)
    return [part.strip() for part in text.split(";")] if text else []


def placeholders(e: Expr, observable: str) -> set[str]:
    """The placeholders of an observable's formula."""
    kinds = ("observableParameter", "noiseParameter")
    found = set()
    for name in e.symbols():
        head, _, tail = name.partition("_")
        if tail == observable and head.startswith(kinds):
            found.add(name)
    return found
