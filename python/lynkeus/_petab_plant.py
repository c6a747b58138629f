"""A PEtab problem as a plant, with the columns of its logs."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ._petab_math import (
    TAKEN,
    Expr,
    call,
    computed,
    modelica,
    number,
    over,
    spelled,
    symbol,
    times,
    total,
)
from ._petab_sbml import Quantity, Sbml
from ._petab_tables import Measurement, Parameter, Tables, placeholders
from .errors import InputError

#: so many times the longest of the finite times, or 1, is as good as infinite
LONG = 1e8

#: the value of an input in a log at a time; the second time is that of the next row
Column = Callable[[int, float, float], float]


@dataclass
class Channel:
    """An output with its noise: the measurements of an observable that have the same formula."""

    name: str
    observable: str
    #: with what stands for the placeholders
    formula: Expr
    noise: Expr
    transformation: str
    measurements: list[Measurement] = field(default_factory=list)


@dataclass
class Fitted:
    """A parameter that is fitted, as the plant has it."""

    #: its row in the table
    own: Parameter
    #: its name in the plant, and its value of that of the table and back
    name: str
    lower: float
    upper: float
    start: float
    #: whether the plant has its decimal logarithm, on which its prior is normal
    is_power: bool = False
    prior: dict[str, float] | None = None


class Plant:
    """The equations, in Modelica, and the columns of known inputs.

    Raises
    ------
    InputError
        What no equation says, with the name of what it is about.
    """

    def __init__(self, tables: Tables, sbml: Sbml) -> None:
        self.tables, self.sbml = tables, sbml
        self.notes: list[str] = []
        #: the conditions of each log: that of the steady state before it, or none, and its own
        self.logs = list(dict.fromkeys(one.log for one in tables.measurements))
        self.places = {log: place for place, log in enumerate(self.logs)}
        ends = [0.0] * len(self.logs)
        for one in tables.measurements:
            place = self.places[one.log]
            if math.isfinite(one.time):
                ends[place] = max(ends[place], one.time)
        self.ends = ends
        #: a time after which a steady state is reached
        self.long = LONG * (max(ends) or 1.0)
        for one in tables.measurements:
            if one.time == math.inf and ends[self.places[one.log]] > 0:
                what = f"row {one.row + 1}: a steady state (time = inf) in a condition with other times"
                raise tables.refused("measurement", what)
        #: the log and the condition of each phase: before a log, and of it
        self.phases = [
            (place, condition) for place, log in enumerate(self.logs) for condition in log if condition
        ]
        self.first = [next(k for k, one in enumerate(self.phases) if one[0] == place) for place in range(len(ends))]
        self.used = {*sbml.quantities, *tables.parameters, *tables.observables, sbml.name}
        #: instants beside those of the measurements at which something jumps
        self.breaks: list[set[float]] = [set() for _ in self.logs]
        self.columns: dict[str, Column] = {}
        #: inputs that are the same throughout a phase
        self.constants: dict[str, list[float]] = {}
        self.patterns: dict[tuple[str, tuple[float, ...]], str] = {}
        self.numbers: dict[str, float] = {}
        self.fitted: dict[str, Fitted] = {}
        #: what formulas of the model and of observables mean by a name
        self.means: dict[str, Expr] = {}
        self.starts: dict[tuple[str, bool], Expr] = {}
        #: declarations and equations
        self.states: list[tuple[str, Expr | None, Expr]] = []
        self.variables: list[tuple[str, Expr]] = []
        self._take_parameters()
        self.overridden = self._overridden()
        self._take_quantities()
        self.channels: list[Channel] = []
        self._take_observables()
        self._find_jumps()

    def fresh(self, name: str) -> str:
        """A name that nothing has."""
        found, k = name, 1
        while found in self.used or found in TAKEN:
            k += 1
            found = f"{name}_{k}"
        self.used.add(found)
        return found

    # parameters

    def _take_parameters(self) -> None:
        for own in self.tables.parameters.values():
            if not own.estimate:
                self.numbers[own.id] = own.nominal
                continue
            fitted = self._fitted(own)
            self.fitted[own.id] = fitted
            if fitted.is_power:
                self.means[own.id] = Expr("^", (number(10.0), symbol(fitted.name)))

    def _fitted(self, own: Parameter) -> Fitted:
        lower, upper = own.lower, own.upper
        prior = own.prior
        if prior is not None and prior.kind in ("uniform", "parameterScaleUniform"):
            ends = prior.numbers if prior.kind == "uniform" else tuple(own.off_scale(x) for x in prior.numbers)
            lower, upper = max(lower, ends[0]), min(upper, ends[1])
            prior = None
        if math.isnan(lower) or math.isnan(upper) or not lower < upper:
            raise self.tables.refused("parameter", f"{own.id}: expected bounds, found [{lower}, {upper}]")
        if own.scale != "lin" and lower <= 0:
            what = f"{own.id}: a {own.scale} scale from {lower} on; expected a lowerBound above 0"
            raise self.tables.refused("parameter", what)
        start = min(max(own.nominal, lower), upper)
        if start != own.nominal:
            self.notes.append(
                f"{own.id}: its nominalValue {own.nominal} is beyond its bounds: it starts at {start}"
            )
        made = Fitted(own, own.id, lower, upper, start)
        if prior is None:
            return made
        mean, sd = prior.numbers
        if prior.kind == "normal" or (prior.kind == "parameterScaleNormal" and own.scale == "lin"):
            made.prior = {"mean": mean, "sd": sd}
        elif prior.kind == "parameterScaleNormal":
            # normal in the decimal logarithm, which is what the plant has then
            share = 1.0 if own.scale == "log10" else 1.0 / math.log(10.0)
            made.name, made.is_power = self.fresh(f"log10_{own.id}"), True
            made.lower, made.upper, made.start = (math.log10(x) for x in (lower, upper, start))
            made.prior = {"mean": share * mean, "sd": share * sd}
        else:
            self.notes.append(f"{own.id}: its prior, {prior.kind}, is not normal: it is left out")
        return made

    def named(self, e: Expr) -> Expr:
        """With what names mean."""
        return e.put(self.means)

    # what differs from log to log

    def _overridden(self) -> dict[str, list[Expr | None]]:
        conditions = [self.tables.conditions[name] for _, name in self.phases]
        names = dict.fromkeys(name for condition in conditions for name in condition)
        found: dict[str, list[Expr | None]] = {}
        for name in names:
            if name in self.tables.parameters:
                what = f"{name} is in the table of parameters as well: expected it in one of them"
                raise self.tables.refused("condition", what)
            if name not in self.sbml.quantities:
                raise self.tables.refused("condition", f'the model has nothing called "{name}"')
            own = self.sbml.quantities[name]
            if own.rule is not None and own.rule[0] == "assignment":
                raise self.tables.refused("condition", f"{name} follows from a rule of the model")
            found[name] = [
                None if name not in condition else self.named(condition[name]) for condition in conditions
            ]
        return found

    def varying(self, name: str, values: list[Expr]) -> Expr:
        """What has these values in the phases, in parameters and inputs."""
        if all(value == values[0] for value in values):
            return values[0]
        terms: list[Expr] = []
        numbers = [value.value if value.op == "number" else 0.0 for value in values]
        if any(numbers):
            is_all = all(value.op == "number" for value in values)
            terms.append(symbol(self._constant(name if is_all else f"{name}_value", numbers)))
        for one in dict.fromkeys(value for value in values if value.op != "number"):
            pattern = tuple(float(value == one) for value in values)
            terms.append(times(symbol(self._constant("case", list(pattern))), one))
        return total(terms)

    def _constant(self, name: str, values: list[float]) -> str:
        """An input with these values in the phases."""
        key = (name, tuple(values))
        if key not in self.patterns:
            own = name if name in self.sbml.quantities and name not in self.columns else self.fresh(name)
            self.patterns[key] = own
            self.constants[own] = values
            self.columns[own] = lambda log, t, after: values[self.phase(log, t)]
        return self.patterns[key]

    def phase(self, log: int, t: float) -> int:
        """That of a log at a time."""
        return self.first[log] + int(bool(self.logs[log][0]) and t >= 0)

    # the model

    def _take_quantities(self) -> None:
        """Parameters and compartments first: starts are written in them."""
        for own in self.sbml.quantities.values():
            if own.id in self.tables.parameters or self.sbml.is_state(own) or own.rule is not None:
                continue
            if own.kind != "species" and not own.is_assigned and own.id not in self.overridden:
                if own.initial is not None:
                    self.numbers[own.id] = own.initial.value
        for own in self.sbml.quantities.values():
            if own.id not in self.tables.parameters and own.id not in self.numbers:
                self._take(own)

    def start(self, name: str, is_first: bool = True, within: tuple[str, ...] = ()) -> Expr:
        """Where something starts, in parameters and inputs: at the first phase of each log, or at each phase."""
        key = (name, is_first)
        if key not in self.starts:
            if name in within:
                raise self.sbml.refused(f"the starts of {', '.join(within)} need each other")
            self.starts[key] = self._start(name, is_first, (*within, name))
        return self.starts[key]

    def _start(self, name: str, is_first: bool, within: tuple[str, ...]) -> Expr:
        if name in self.means:
            return self.means[name]
        own = self.sbml.quantities.get(name)
        if name in self.tables.parameters or name in self.numbers or own is None:
            return symbol(name)
        if own.rule is not None and own.rule[0] == "assignment":
            return self.at_start(own.rule[1], is_first, within)
        given = self.overridden.get(name, [None] * len(self.phases))
        default = number(0.0)
        if any(value is None for value in given):
            said = self.sbml.start(own)
            if said is None:
                raise self.sbml.refused(f"nothing says where {name} starts")
            default = self.at_start(said, is_first, within)
        values = [default if value is None else value for value in given]
        if is_first:
            values = [values[self.first[log]] for log, _ in self.phases]
        stays = is_first and any(before for before, _ in self.logs)
        return self.varying(f"{name}_start" if stays or self.sbml.is_state(own) else name, values)

    def at_start(self, e: Expr, is_first: bool, within: tuple[str, ...] = ()) -> Expr:
        def change(part: Expr) -> Expr | None:
            if part.op == "time":
                return number(0.0)
            return self.start(part.value, is_first, within) if part.op == "symbol" else None

        return e.changed(change)

    def _take(self, own: Quantity) -> None:
        if own.rule is not None and own.rule[0] == "assignment":
            self.variables.append((own.id, self.named(own.rule[1])))
            return
        is_dense = own.kind == "species" and not own.is_amount and own.rule is None
        varies = is_dense and self.sbml.varies(own.compartment)
        size = symbol(own.compartment)
        if not self.sbml.is_state(own):
            start = self.start(own.id, is_first=False)
            if varies:
                start = over(times(start, self.start(own.compartment)), size)
            self._hold(own.id, start)
            return
        start = self.start(own.id)
        derivative = self.named(self.sbml.derivative(own))
        if is_dense and not varies:
            derivative = over(derivative, self.named(size))
        if not varies:
            self._state(own.id, start, derivative, self._resets(own.id))
            return
        if self._resets(own.id):
            raise self.sbml.refused(f"{own.id} starts anew after a steady state, in a compartment that varies")
        # the amount is what reactions change
        amount = self.fresh(f"{own.id}_amount")
        self.variables.append((own.id, over(symbol(amount), size)))
        self._state(amount, times(start, self.start(own.compartment)), derivative, {})

    def _resets(self, name: str) -> dict[int, Expr]:
        """The phases after a steady state at which a state starts anew, and where."""
        given = self.overridden.get(name, [])
        later = (k for k, (log, _) in enumerate(self.phases) if k != self.first[log])
        return {k: value for k in later if given and (value := given[k]) is not None}

    def _hold(self, name: str, value: Expr) -> None:
        """Something that stays."""
        if value == symbol(name):
            return
        if value.op == "number":
            self.numbers[name] = value.value
        else:
            self.variables.append((name, value))

    def _state(self, name: str, start: Expr, derivative: Expr, resets: dict[int, Expr]) -> None:
        is_same = not any(one in self.columns for one in start.symbols())
        if is_same and not resets:
            self.states.append((name, start, derivative))
            return
        # a start of a plant is the same in all logs: what it has moved since starts at 0 in each of them
        moved = self.fresh(f"{name}_moved")
        whole = total([start, symbol(moved)])
        self.states.append((moved, number(0.0), derivative))
        if resets:
            # what it was in the steady state before is kept, and left out from then on
            kept = self.fresh(f"{name}_before")
            is_before = [float(k in self.first and bool(self.logs[log][0])) for k, (log, _) in enumerate(self.phases)]
            factor = times(symbol(self._constant("before", is_before)), number(LONG / self.long))
            self.states.append((kept, number(0.0), times(factor, Expr("-", (whole, symbol(kept))))))
            none = number(0.0)
            put = [Expr("-", (resets[k], symbol(kept))) if k in resets else none for k in range(len(self.phases))]
            whole = total([whole, self.varying(f"{name}_put", put)])
        self.variables.append((name, whole))

    # what is measured

    def _take_observables(self) -> None:
        groups: dict[tuple[Any, ...], list[Measurement]] = defaultdict(list)
        count: dict[tuple[Any, ...], int] = defaultdict(int)
        for one in self.tables.measurements:
            self._check_placeholders(one)
            shape = tuple((name, None if e.op == "number" else e) for name, e in sorted(one.overrides.items()))
            at = (one.observable, shape, one.log, one.time)
            groups[one.observable, shape, count[at]].append(one)
            count[at] += 1
        of: dict[str, int] = defaultdict(int)
        for observable, _, _ in groups:
            of[observable] += 1
        for (observable, _, _), own in groups.items():
            base = observable if observable not in self.sbml.quantities else f"obs_{observable}"
            is_free = of[observable] == 1 and base == observable
            self._channel(base if is_free else self.fresh(base if of[observable] == 1 else f"{base}_1"), own)

    def _check_placeholders(self, one: Measurement) -> None:
        own = self.tables.observables[one.observable]
        needed = placeholders(own.formula, own.id) | placeholders(own.noise, own.id)
        missing = needed - set(one.overrides) - set(self.tables.parameters)
        if missing:
            what = f"row {one.row + 1}: nothing stands for {', '.join(sorted(missing))}"
            raise self.tables.refused("measurement", what)

    def _channel(self, name: str, own: list[Measurement]) -> None:
        observable = self.tables.observables[own[0].observable]
        values: dict[str, Expr] = {}
        for placeholder, first in own[0].overrides.items():
            numbers = {(self.places[one.log], self.instant(one)): one.overrides[placeholder] for one in own}
            if all(value == first for value in numbers.values()):
                values[placeholder] = self.named(first)
            else:
                values[placeholder] = symbol(self._by_row(placeholder, numbers))
        put = [self.named(e.put(values)) for e in (observable.formula, observable.noise)]
        known = {*self.sbml.quantities, *self.tables.parameters, *self.columns}
        known.update(fitted.name for fitted in self.fitted.values())
        for e in put:
            strange = [one for one in e.symbols() if one not in known]
            if strange:
                what = f"observable {observable.id}: nothing is called \"{strange[0]}\""
                raise InputError(f"{self.tables.path}: {what}")
        self.channels.append(Channel(name, observable.id, put[0], put[1], observable.transformation, own))

    def _by_row(self, placeholder: str, values: dict[tuple[int, float], Expr]) -> str:
        name = self.fresh(placeholder)
        spare = next(iter(values.values())).value
        self.columns[name] = lambda log, t, after: (
            values[log, t].value if (log, t) in values else spare
        )
        return name

    # what jumps at known times

    def _find_jumps(self) -> None:
        self.inlined = {name: e for name, e in self.variables}
        self.jumps: dict[Expr, Expr | None] = {}
        self.states = [(name, start, self._stepped(e)) for name, start, e in self.states]
        self.variables = [(name, self._stepped(e)) for name, e in self.variables]
        for channel in self.channels:
            channel.formula = self._stepped(channel.formula)
            channel.noise = self._stepped(channel.noise)
        self._refuse_time()

    def _stepped(self, e: Expr) -> Expr:
        def change(part: Expr) -> Expr | None:
            if part.op not in ("<", "<=", ">", ">="):
                return None
            if part not in self.jumps:
                self.jumps[part] = self._jump(part)
            return self.jumps[part]

        return e.changed(change)

    def _written_out(self, e: Expr, depth: int = 0) -> Expr:
        """With variables as what they follow from."""
        if depth > 20:
            return e
        own = {name: self.inlined[name] for name in e.symbols() if name in self.inlined}
        return self._written_out(e.put(own), depth + 1) if own else e

    def _jump(self, relation: Expr) -> Expr | None:
        """A known input in the place of a comparison of time with what is known; rows are where it jumps."""
        whole = self._written_out(relation)
        if not whole.has_time():
            return None
        difference = Expr("-", whole.args)
        if any(name not in self.numbers and name not in self.constants for name in whole.symbols()):
            self.notes.append(
                "an instant at which the model jumps follows from what is fitted or from states: steps go across it"
            )
            return None
        for log, end in enumerate(self.ends):
            values = self._known(self.phase(log, 0.0))
            at = [computed(difference, values, t) for t in (0.0, 1.0, 2.75)]
            slope = at[1] - at[0]
            if abs(at[2] - at[0] - 2.75 * slope) > 1e-9 * max(map(abs, at)):
                self.notes.append("an instant at which the model jumps is not solved for: steps go across it")
                return None
            instant = -at[0] / slope if slope else -1.0
            if 0.0 < instant < end:
                self.breaks[log].add(instant)

        def column(log: int, t: float, after: float) -> float:
            # what comes to a steady state does so after all jumps
            at = 0.5 * (t + after) if t >= 0 else self.long
            return computed(whole, self._known(self.phase(log, t)), at)

        name = self.fresh("step")
        self.columns[name] = column
        return Expr(">", (symbol(name), number(0.5)))

    def _known(self, phase: int) -> dict[str, float]:
        """Numbers and inputs of a phase."""
        return self.numbers | {name: own[phase] for name, own in self.constants.items()}

    @property
    def settles(self) -> bool:
        """Whether something comes to a steady state."""
        return any(before for before, _ in self.logs) or any(
            one.time == math.inf for one in self.tables.measurements
        )

    def _refuse_time(self) -> None:
        """What goes on with time comes to no steady state."""
        whole = [e for _, _, e in self.states] + [e for _, e in self.variables]
        if any(before for before, _ in self.logs) and any(e.has_time() for e in whole):
            raise self.sbml.refused("a steady state is asked of equations that go on with time")

    # what becomes of it

    def times(self, log: int) -> list[float]:
        """The rows of a log: the start, the measurements, and where something jumps."""
        own = {self.instant(one) for one in self.tables.measurements if self.places[one.log] == log}
        before = {-self.long} if self.logs[log][0] else set()
        return sorted({0.0, *before, *own, *self.breaks[log]})

    def instant(self, one: Measurement) -> float:
        """The row of a measurement."""
        return one.time if math.isfinite(one.time) else self.long

    def table(self, log: int) -> dict[str, np.ndarray[Any, Any]]:
        """The columns of a log by their names."""
        at = self.times(log)
        after = [*at[1:], at[-1] + 1.0]
        found = {"t": np.array(at)}
        for name, column in self.columns.items():
            found[name] = np.array([column(log, t, then) for t, then in zip(at, after, strict=True)])
        rows = {t: row for row, t in enumerate(at)}
        for channel in self.channels:
            readings = np.full(len(at), math.nan)
            for one in channel.measurements:
                if self.places[one.log] == log:
                    readings[rows[self.instant(one)]] = transformed(one.value, channel.transformation)
            found[channel.name] = readings
        return found

    def text(self) -> str:
        """The plant in Modelica."""

        def quoted(name: str) -> str:
            return f"'{name}'" if name in TAKEN else name

        def written(e: Expr) -> str:
            return modelica(e, quoted)

        lines = [f"model {quoted(self.name)}"]
        for one in self.fitted.values():
            ends = f"min = {spelled(one.lower)}, max = {spelled(one.upper)}"
            lines.append(f"  parameter Real {quoted(one.name)}({ends}) = {spelled(one.start)};")
        read = self._read()
        for name, value in self.numbers.items():
            if name in read:
                lines.append(f"  parameter Real {quoted(name)} = {spelled(value)};")
        lines += [f"  input Real {quoted(name)};" for name in self.columns]
        for name, start, _ in self.states:
            begin = number(0.0) if start is None else start
            lines.append(f"  Real {quoted(name)}(start = {written(begin)}, fixed = true);")
        lines += [f"  Real {quoted(name)};" for name, _ in self.variables]
        lines += [f"  Real {quoted(name)};" for name, _ in self.deviations]
        lines += [f"  output Real {quoted(channel.name)};" for channel in self.channels]
        lines.append("equation")
        lines += [f"  der({quoted(name)}) = {written(e)};" for name, _, e in self.states]
        lines += [f"  {quoted(name)} = {written(e)};" for name, e in self.variables]
        lines += [f"  {quoted(name)} = {written(e)};" for name, e in self.deviations]
        for channel in self.channels:
            formula = channel.formula
            if channel.transformation != "lin":
                formula = call(channel.transformation, formula)
            lines.append(f"  {quoted(channel.name)} = {written(formula)};")
        lines.append(f"end {quoted(self.name)};")
        return "\n".join(lines) + "\n"

    @property
    def name(self) -> str:
        """Of the model."""
        return self.sbml.name

    def _read(self) -> set[str]:
        """Names that some equation reads."""
        all_of = [e for _, e in (*self.variables, *self.deviations)]
        all_of += [e for _, start, derivative in self.states for e in (start, derivative) if e is not None]
        all_of += [e for channel in self.channels for e in (channel.formula, channel.noise)]
        return {name for e in all_of for name in e.symbols()}

    def noise(self) -> tuple[dict[str, float], dict[str, str]]:
        """The standard deviations that are numbers, and those that parameters or variables of the plant are."""
        numbers: dict[str, float] = {}
        named: dict[str, str] = {}
        self.deviations: list[tuple[str, Expr]] = []
        made: dict[Expr, str] = {}
        nominal = self.numbers | {one.name: one.start for one in self.fitted.values()}
        for channel in self.channels:
            e = channel.noise
            try:
                value = computed(e, nominal)
            except KeyError:
                value = None
            except (ArithmeticError, ValueError):
                value = math.nan
            if value is not None:
                if not value > 0 or not math.isfinite(value):
                    what = f"observable {channel.observable}: expected noise above 0, found {value}"
                    raise InputError(f"{self.tables.path}: {what}")
                numbers[channel.name] = value
            if all(name in self.numbers for name in e.symbols()) and not e.has_time():
                continue
            if e.op == "symbol" and e.value not in self.columns:
                named[channel.name] = e.value
                continue
            if e not in made:
                made[e] = self.fresh(f"{channel.name}_sd")
                self.deviations.append((made[e], e))
            named[channel.name] = made[e]
        return numbers, named


def transformed(value: float, transformation: str) -> float:
    """A measurement as its noise is added to it."""
    match transformation:
        case "log":
            return math.log(value)
        case "log10":
            return math.log10(value)
    return value


def jacobian(value: float, transformation: str) -> float:
    """What PEtab's likelihood has beside that of the transformed measurement."""
    match transformation:
        case "log":
            return math.log(value)
        case "log10":
            return math.log(value * math.log(10.0))
    return 0.0
