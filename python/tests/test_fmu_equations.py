"""FMUs of plants and of observers in continuous time, run by FMPy: what ``lynkeus simulate`` gives."""

from __future__ import annotations

import ctypes
import functools
import re
import shutil
import subprocess
import tomllib
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from conftest import ALL, ROOT
from test_fmu import run, table

fmpy = pytest.importorskip("fmpy")
pytest.importorskip("fmpy.fmi1")
fmi2 = pytest.importorskip("fmpy.fmi2")
fmi3 = pytest.importorskip("fmpy.fmi3")
validation = pytest.importorskip("fmpy.validation")

pytestmark = pytest.mark.skipif(
    not any(map(shutil.which, ("cc", "gcc", "clang"))), reason="there is no C compiler"
)

Array = np.ndarray[Any, Any]

STAIRS = 16
"""How often the inputs of a whole run jump; between two jumps they stay, as in co-simulation."""

JUMPS = 6
"""How many of them are run."""

STUDIES = sorted((ROOT / "examples").glob("*/*.toml"))
PLANTS = {study.parent / tomllib.loads(study.read_text())["plant"]: study for study in STUDIES}
NAMES = [model.relative_to(ROOT).as_posix() for model in PLANTS]


def versions(names: Iterable[str]) -> list[tuple[str, int]]:
    """Each by one version of the standard, in turn; where all tests run, by both."""
    return [(name, v) for i, name in enumerate(names) for v in (2, 3) if ALL or v == 2 + i % 2]


def export(command: Path, folder: Path, source: Path, *options: str) -> Path:
    folder.mkdir(exist_ok=True)
    run(command, folder, "export", str(source), "--to", "fmu", "-o", "fmu", "--force", *options)
    (file,) = (folder / "fmu").glob("*.fmu")
    assert validation.validate_fmu(str(file)) == []
    return file


def simulated(command: Path, folder: Path, study: Path, changes: dict[str, str]) -> dict[str, Array]:
    """The columns of a study whose ``[simulate]`` has other keys, and whose sensors have no noise."""
    before, _, rest = study.read_text().partition("[simulate]\n")
    assert "\nnoise = " not in rest
    lines, *others = rest.split("\n[")
    kept = [line for line in lines.splitlines() if line.split(" = ")[0] not in changes]
    kept += [f"{key} = {value}" for key, value in changes.items()]
    before = re.sub(r"(?m)^noise = .*$", "", before)
    (folder / "changed.toml").write_text("\n[".join([before + "[simulate]\n" + "\n".join(kept), *others]))
    shutil.copy(study.parent / tomllib.loads(before)["plant"], folder)
    run(command, folder, "simulate", "changed.toml", "-q", "-o", "run.csv")
    columns = table(folder / "run.csv")
    # whole steps, also of a run that the observer ends early
    rows = len(columns["t"]) // 2 * 2 - 1
    return {column: values[:rows] for column, values in columns.items()}


def stairs(study: Path) -> tuple[float, dict[str, str]]:
    """How long a step of the inputs is, and ``[simulate]`` with such steps and two rows for each."""
    settings = tomllib.loads(study.read_text())["simulate"]
    length = settings["until"] / STAIRS
    held = re.compile(r"\btime\b")
    written = {
        name: repr(str(value)).replace("'", '"')
        for name, value in settings.get("inputs", {}).items()
    }
    inputs = ", ".join(
        f"{name} = " + held.sub(f"({length}*floor(time/{length}))", value) for name, value in written.items()
    )
    return length, {
        "inputs": f"{{ {inputs} }}",
        "until": repr(JUMPS * length),
        "output_step": repr(length / 2),
    }


def signals(model: Any, columns: dict[str, Array]) -> Array | None:
    """Inputs for FMPy that are in each step what they are in its middle."""
    names = [v.name for v in model.modelVariables if v.causality == "input"]
    if not names:
        return None
    time = np.repeat(columns["t"][::2], 2)[1:-1]
    values = [np.repeat(columns[name][1::2], 2) for name in names]
    return np.array(
        list(zip(time, *values, strict=True)), dtype=[("time", float), *((name, float) for name in names)]
    )


class Made:
    """What several tests take of a model, made once."""

    def __init__(self, command: Path, folder: Path) -> None:
        self.command, self.folder = command, folder
        self.file = functools.cache(self._file)
        self.columns = functools.cache(self._columns)

    def _file(self, name: str, version: int) -> Path:
        length, _ = stairs(PLANTS[ROOT / name])
        folder = self.folder / f"{name.replace('/', '-')}-{version}"
        options = ["--fmi", str(version), "--step", repr(length / 2000)]
        return export(self.command, folder, ROOT / name, *options)

    def _columns(self, name: str) -> dict[str, Array]:
        folder = self.folder / name.replace("/", "-")
        folder.mkdir()
        study = PLANTS[ROOT / name]
        return simulated(self.command, folder, study, stairs(study)[1])


@pytest.fixture(scope="module")
def made(command: Path, tmp_path_factory: pytest.TempPathFactory) -> Made:
    return Made(command, tmp_path_factory.mktemp("made"))


@pytest.mark.parametrize(("name", "version"), versions(NAMES))
def test_a_plant_runs_as_simulate_runs_it(made: Made, name: str, version: int) -> None:
    length, _ = stairs(PLANTS[ROOT / name])
    expected, file = made.columns(name), made.file(name, version)
    assert len(expected["t"]) > 6
    told = fmpy.read_model_description(str(file))
    assert told.coSimulation is not None and told.modelExchange is not None
    recorded = [v.name for v in told.modelVariables if v.name in expected and v.causality != "input"]
    states = [v.derivative.name for v in told.modelVariables if v.derivative]
    assert set(states) <= set(recorded)
    starts = {state: expected[state][0] for state in states}
    for kind in ("CoSimulation", "ModelExchange"):
        result = fmpy.simulate_fmu(
            str(file),
            fmi_type=kind,
            start_time=expected["t"][0],
            stop_time=expected["t"][-1],
            output_interval=length / 16,
            input=signals(told, expected),
            output=recorded,
            start_values=starts,
            relative_tolerance=1e-10,
        )
        for column in recorded:
            values = [result[column][np.abs(result["time"] - t) < 1e-9 * length][0] for t in expected["t"]]
            size = np.max(np.abs(expected[column])) or 1.0
            error = np.max(np.abs(values - expected[column])) / size
            assert error <= 1e-6, (kind, column)


class Equations:
    """An FMU for model exchange, in either version of the standard, in continuous-time mode."""

    def __init__(self, file: Path) -> None:
        self.model = fmpy.read_model_description(str(file))
        is_three = self.model.fmiVersion.startswith("3")
        variables = self.model.modelVariables
        self.places = {v.name: v.valueReference for v in variables}
        derivatives = [v for v in variables if v.derivative]
        self.derivatives = [v.name for v in derivatives]
        self.states = [v.derivative.name for v in derivatives]
        self.inputs = [v.name for v in variables if v.causality == "input"]
        self.starts = {v.name: float(v.start) for v in variables if v.start is not None}
        self.fmu = (fmi3.FMU3Model if is_three else fmi2.FMU2Model)(
            guid=self.model.guid,
            unzipDirectory=fmpy.extract(str(file)),
            modelIdentifier=self.model.modelExchange.modelIdentifier,
            instanceName="equations",
        )
        self.fmu.instantiate()
        if not is_three:
            self.fmu.setupExperiment(startTime=0.0)
        self.fmu.enterInitializationMode()
        self.fmu.exitInitializationMode()
        self.fmu.enterContinuousTimeMode()
        self.read = self.fmu.getFloat64 if is_three else self.fmu.getReal
        self.write = self.fmu.setFloat64 if is_three else self.fmu.setReal

    def get(self, names: list[str]) -> Array:
        return np.array(self.read([self.places[name] for name in names]))

    def at(self, time: float, states: Array, inputs: Array) -> None:
        self.fmu.setTime(time)
        self.fmu.setContinuousStates((ctypes.c_double * len(states))(*states), len(states))
        self.write([self.places[name] for name in self.inputs], list(inputs))

    def along(self, unknowns: list[str], knowns: list[str], seed: Array) -> Array:
        places = [[self.places[name] for name in names] for names in (unknowns, knowns)]
        return np.array(self.fmu.getDirectionalDerivative(*places, list(seed)))

    def close(self) -> None:
        self.fmu.terminate()
        self.fmu.freeInstance()


def inside(model: Any, name: str, random: np.random.Generator) -> float:
    """A value of a variable that is off its start, within its range."""
    (variable,) = (v for v in model.modelVariables if v.name == name)
    value = float(variable.start) * (1 + 0.1 * random.uniform()) + 0.05 * random.uniform()
    low, high = (float(v) if v is not None else None for v in (variable.min, variable.max))
    return float(np.clip(value, low, high)) if low is not None or high is not None else value


def jacobian(equations: Equations, unknowns: list[str], point: Array) -> Array:
    """By central differences in time, the states and the inputs."""
    n = len(equations.states)

    def values(moved: Array) -> Array:
        equations.at(moved[0], moved[1 : 1 + n], moved[1 + n :])
        return equations.get(unknowns)

    columns = []
    for place, value in enumerate(point):
        step = np.zeros_like(point)
        step[place] = 1e-5 * max(1.0, abs(value))
        columns.append((values(point + step) - values(point - step)) / (2 * step[place]))
    values(point)
    return np.column_stack(columns)


def check_derivatives(file: Path) -> None:
    """Columns, and the product with a seed, against differences; nothing outside of what is declared."""
    random = np.random.default_rng(1)
    equations = Equations(file)
    outputs = [v.variable.name for v in equations.model.outputs]
    unknowns = equations.derivatives + outputs
    knowns = ["time", *equations.states, *equations.inputs]
    point = np.array([0.7, *(inside(equations.model, name, random) for name in knowns[1:])])
    expected = jacobian(equations, unknowns, point)
    found = np.column_stack([equations.along(unknowns, [known], np.ones(1)) for known in knowns])
    size = np.max(np.abs(expected), axis=1, keepdims=True)
    assert np.all(np.abs(found - expected) <= 1e-6 * size + 1e-8)
    seed = random.standard_normal(len(knowns))
    np.testing.assert_allclose(equations.along(unknowns, knowns, seed), found @ seed, rtol=1e-9, atol=1e-9)
    declared = {v.variable.name: {d.name for d in v.dependencies} for v in equations.model.outputs}
    declared |= {v.variable.name: {d.name for d in v.dependencies} for v in equations.model.derivatives}
    for row, unknown in zip(found, unknowns, strict=True):
        assert {known for known, slope in zip(knowns, row, strict=True) if slope} <= declared[unknown]
    with pytest.raises(Exception, match="DirectionalDerivative"):
        equations.along(["time"], knowns, seed)
    equations.close()


@pytest.mark.parametrize(("name", "version"), versions(NAMES))
def test_directional_derivatives_are_those_of_the_plant(made: Made, name: str, version: int) -> None:
    check_derivatives(made.file(name, version))


VAT = """
model Vat
  input Real feed(start = 1);
  output Real level(start = 0, min = 0);
  Real dye(start = 2);
equation
  der(level) = feed - sqrt(level);
  der(dye) = feed*(3 - dye) - sqrt(level)*dye;
end Vat;
"""


@pytest.mark.parametrize("version", [2, 3])
def test_of_an_empty_tank_all_columns_but_the_level_s_can_be_had(
    command: Path, tmp_path: Path, version: int
) -> None:
    (tmp_path / "vat.mo").write_text(VAT)
    equations = Equations(export(command, tmp_path, tmp_path / "vat.mo", "--fmi", str(version)))
    unknowns = ["der(level)", "der(dye)"]
    equations.at(0.0, np.array([0.0, 2.0]), np.array([1.0]))
    for known, slopes in (("feed", [1, 1]), ("dye", [0, -1]), ("time", [0, 0])):
        assert list(equations.along(unknowns, [known], np.ones(1))) == slopes
    knowns = ["level", "dye", "feed"]
    assert list(equations.along(unknowns, knowns, np.array([0.0, 2.0, 0.5]))) == [0.5, -1.5]
    with pytest.raises(Exception, match="DirectionalDerivative"):
        equations.along(unknowns, knowns, np.ones(3))
    equations.close()


@pytest.mark.parametrize("version", [2, 3])
def test_parameters_can_be_set(command: Path, tmp_path: Path, version: int) -> None:
    """Before the start, against ``simulate`` with others; and on the way, from there on."""
    study, values = ROOT / "examples/two-tanks/study.toml", {"k1": 0.05, "k3": 0.04}
    length, changes = stairs(study)
    given = "".join(f"{name} = {value}\n" for name, value in values.items())
    (tmp_path / "other").mkdir()
    other = tmp_path / "other/study.toml"
    other.write_text(study.read_text() + "\n[parameters]\n" + given)
    shutil.copy(study.parent / "two_tanks.mo", other.parent)
    expected = simulated(command, tmp_path, other, changes)
    options = ["--fmi", str(version), "--step", repr(length / 2000)]
    file = export(command, tmp_path, study.parent / "two_tanks.mo", *options)
    told = fmpy.read_model_description(str(file))
    offered = {v.name: float(v.start) for v in told.modelVariables if v.causality == "parameter"}
    assert offered == {"k1": 0.03951, "k2": 0.07283, "k3": 0.06651, "k4": 0.03037}
    states = {v.derivative.name: expected[v.derivative.name] for v in told.modelVariables if v.derivative}
    for kind in ("CoSimulation", "ModelExchange"):
        result = fmpy.simulate_fmu(
            str(file),
            fmi_type=kind,
            start_time=expected["t"][0],
            stop_time=expected["t"][-1],
            output_interval=length / 16,
            input=signals(told, expected),
            output=list(states),
            start_values=values | {state: column[0] for state, column in states.items()},
            relative_tolerance=1e-10,
        )
        for state, column in states.items():
            found = [result[state][np.abs(result["time"] - t) < 1e-9 * length][0] for t in expected["t"]]
            assert np.max(np.abs(found - column)) <= 1e-6 * np.max(np.abs(column)), (kind, state)
    equations = Equations(file)
    equations.at(0.0, np.array([4.0, 9.0]), np.array([2.0]))
    assert equations.get(["der(upper)"])[0] == pytest.approx(-2 * 0.03951 + 2 * 0.03037, rel=1e-14)
    equations.write([equations.places["k1"]], [0.5])
    assert equations.get(["der(upper)"])[0] == pytest.approx(-2 * 0.5 + 2 * 0.03037, rel=1e-14)
    assert equations.along(["der(upper)"], ["upper"], np.ones(1))[0] == pytest.approx(-0.125, rel=1e-14)
    equations.close()


OBSERVERS: dict[str, dict[str, str]] = {
    "two-tanks/study.toml": {"pump": "3 + sin(time/50)"},
    "lee/study.toml": {"u": "2*sin(3*time)"},
    "farza/study.toml": {"v": "5*sin(5*time)"},
    "ltaief/study.toml": {
        "u1": "sin(11*pi*time)",
        "u2": "cos(11*pi*time)",
        "u3": "5*cos(2*pi*time)",
        "e1": "0.1*sin(0.1*pi*time)",
    },
    "predator-prey/study.toml": {},
    "germani-manes/theoretical.toml": {"u": "5 + 2*sin(2*pi*time)"},
}
"""Studies of several families, and inputs that are written alike in Modelica and Python."""

SLOPES = {f"u{chr(39) * k}": f"2*(2*pi)**{k}*sin(2*pi*time + {k}*pi/2)" for k in (1, 2, 3)}
"""Derivatives of the input that the last of these observers reads."""


def runge_kutta(slopes: Callable[[float, Array], Array], time: float, x: Array, step: float) -> Array:
    first = slopes(time, x)
    second = slopes(time + step / 2, x + step / 2 * first)
    third = slopes(time + step / 2, x + step / 2 * second)
    fourth = slopes(time + step, x + step * third)
    return x + step / 6 * (first + 2 * (second + third) + fourth)


@pytest.mark.parametrize(("name", "version"), versions(OBSERVERS))
def test_plant_and_observer_run_together_as_simulate_runs_them(
    command: Path, tmp_path: Path, name: str, version: int
) -> None:
    study, inputs = ROOT / "examples" / name, OBSERVERS[name]
    until = tomllib.loads(study.read_text())["simulate"]["until"]
    step = until / 4000
    given = ", ".join(f'{name} = "{value}"' for name, value in inputs.items())
    changes = {
        "inputs": f"{{ {given} }}",
        "until": repr(step * 160),
        "output_step": repr(step * 4),
        "method": '"rk4"',
        "step": repr(step),
    }
    expected = simulated(command, tmp_path, study, changes)
    changed = tmp_path / "changed.toml"
    options = ["--fmi", str(version), "--system"]
    plant = Equations(export(command, tmp_path / "p", changed, *options, "plant"))
    observer = Equations(export(command, tmp_path / "o", changed, *options, "observer"))
    known = {name: compile(text, name, "eval") for name, text in (inputs | SLOPES).items()}
    words = {"sin": np.sin, "cos": np.cos, "pi": np.pi}

    def value(name: str, time: float) -> float:
        return float(eval(known[name], words | {"time": time}))

    def slopes(time: float, both: Array) -> Array:
        x, z = np.split(both, [len(plant.states)])
        plant.at(time, x, np.array([value(name, time) for name in plant.inputs]))
        measured = {name: plant.get([name])[0] for name in observer.inputs if name in plant.places}
        of = [value(name, time) if name in known else measured[name] for name in observer.inputs]
        observer.at(time, z, np.array(of))
        return np.concatenate([plant.get(plant.derivatives), observer.get(observer.derivatives)])

    both = np.array([e.starts[state] for e in (plant, observer) for state in e.states])
    told = [v.variable.name for v in observer.model.outputs]
    assert {f"{state}_hat" for state in plant.states} <= set(told)
    for row, time in enumerate(expected["t"]):
        slopes(time, both)
        for names, values in ((plant.states, both), (told, observer.get(told))):
            for column, found in zip(names, values, strict=False):
                size = np.max(np.abs(expected[column])) or 1.0
                assert abs(found - expected[column][row]) <= 1e-9 * size, (column, time)
        for k in range(4):
            both = runge_kutta(slopes, time + k * step, both, step)
    plant.close()
    observer.close()
    check_derivatives(tmp_path / "o" / "fmu" / f"{observer.model.modelExchange.modelIdentifier}.fmu")


EVENTS = {
    "ball": (
        """
model Ball
  parameter Real e = 0.8;
  Real h(start = 1);
  Real v(start = 0);
  discrete Integer n(start = 0);
  output Real y = h;
equation
  der(h) = v;
  der(v) = -9.81;
  when h <= 0 then
    reinit(v, -e*pre(v));
    n = pre(n) + 1;
  end when;
end Ball;
""",
        ["h", "v", "n"],
        2.3,
    ),
    "thermostat": (
        """
model Thermostat
  input Real cold(start = 12);
  Real T(start = 18);
  Boolean on(start = true);
  output Real y = T;
equation
  der(T) = (if on then 8 else 0) - 0.5*(T - cold);
  when T >= 21 then
    on = false;
  elsewhen T <= 19 then
    on = true;
  end when;
end Thermostat;
""",
        ["T", "on"],
        5.0,
    ),
    "dosed": (
        """
model Dosed
  Real c(start = 1);
  Real dose(start = 0.5);
  Integer given(start = 0);
  output Real y = c + given;
equation
  der(c) = -0.7*c;
  when sample(0.3, 0.5) then
    reinit(c, pre(c) + pre(dose));
    given = pre(given) + 1;
  end when;
  when time >= 1.1 then
    dose = 0.1;
  end when;
end Dosed;
""",
        ["c", "dose", "given"],
        3.0,
    ),
    "nothing": (
        """
model Nothing
  Real x(start = 1);
  Real low(start = 2);
  output Real y = x;
equation
  der(x) = -x;
  when initial() then
    low = 3;
  end when;
end Nothing;
""",
        ["x", "low"],
        1.0,
    ),
}
"""Plants whose state jumps: where it leads itself, by an input beside, by the clock alone, at the start alone."""


@pytest.mark.parametrize(("name", "version"), [(name, version) for name in EVENTS for version in (2, 3)])
def test_a_plant_jumps_as_simulate_has_it(command: Path, tmp_path: Path, name: str, version: int) -> None:
    text, columns, end = EVENTS[name]
    (tmp_path / "m.mo").write_text(text)
    rows = 40
    step = end / rows
    study = f'plant = "m.mo"\n[simulate]\nuntil = {end}\noutput_step = {step}\nrtol = 1e-11\n'
    (tmp_path / "s.toml").write_text(study)
    run(command, tmp_path, "simulate", "s.toml", "-q", "-o", "run.csv")
    expected = table(tmp_path / "run.csv")
    file = export(
        command, tmp_path, Path("s.toml"), "--system", "plant", "--fmi", str(version), "--step", str(step / 50)
    )
    told = fmpy.read_model_description(str(file))
    jumping = name in ("ball", "thermostat")
    assert (told.numberOfEventIndicators > 0) == jumping
    for kind in ("CoSimulation", "ModelExchange"):
        result = fmpy.simulate_fmu(
            str(file),
            fmi_type=kind,
            stop_time=end,
            output_interval=step,
            output=columns,
            relative_tolerance=1e-10,
        )
        for column in columns:
            # of several rows of one time the first is before the event
            found = [result[column][np.abs(result["time"] - t) < 1e-9][0] for t in expected["t"]]
            # what jumps within rounding of a row may be on either side there
            wrong = np.abs(found - expected[column]) > 1e-6 * np.max(np.abs(expected[column]))
            assert not wrong[1:].any(), (kind, column, found, expected[column])


def test_events_without_end_end_the_run(command: Path, tmp_path: Path) -> None:
    """The bounces accumulate at 4.06 s. In model exchange the importer looks for them."""
    (tmp_path / "m.mo").write_text(EVENTS["ball"][0])
    file = export(command, tmp_path, Path("m.mo"), "--step", "0.01")
    with pytest.raises(fmpy.fmi1.FMICallException, match="fmi3DoStep failed with status 3"):
        fmpy.simulate_fmu(str(file), fmi_type="CoSimulation", stop_time=6.0, output_interval=0.1)
    result = fmpy.simulate_fmu(str(file), fmi_type="CoSimulation", stop_time=4.0, output_interval=0.1)
    assert result["time"][-1] > 3.9
