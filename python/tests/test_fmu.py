"""FMUs of ``lynkeus export --to fmu``, run by FMPy: valid, and what ``lynkeus estimate`` gives."""

from __future__ import annotations

import csv
import os
import shutil
import subprocess
import zipfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from conftest import ROOT

fmpy = pytest.importorskip("fmpy")
fmi2 = pytest.importorskip("fmpy.fmi2")
fmi3 = pytest.importorskip("fmpy.fmi3")
validation = pytest.importorskip("fmpy.validation")

COMPILER = next(filter(None, map(shutil.which, ("cc", "gcc", "clang"))), "")

pytestmark = pytest.mark.skipif(not COMPILER, reason="there is no C compiler")

EXAMPLES = sorted(p.relative_to(ROOT).as_posix() for p in (ROOT / "examples").glob("*/*.toml"))

FIXED = '[estimate]\nmethod = "rk4"\nsubsteps = 8\n'
FILTER = """
plant = "two_tanks.mo"
[sensors]
measured = ["level"]
unknown = ["pump"]
noise = { level = 0.02 }
[process_noise]
upper = 1e-5
lower = 1e-5
pump = 1e-3
[observer]
family = "ekf"
[simulate]
until = 800
output_step = 4
inputs = { pump = "3 + sin(time/50)" }
"""


def run(command: Path, folder: Path, *arguments: str) -> str:
    done = subprocess.run([command, *arguments], cwd=folder, capture_output=True, text=True, check=False)
    assert done.returncode < 2, done.stderr
    return done.stderr


def table(file: Path) -> dict[str, np.ndarray[Any, Any]]:
    with file.open() as lines:
        header, *rows = csv.reader(lines)
    cells = np.array([[float(cell or "nan") for cell in row] for row in rows])
    return {name: cells[:, place] for place, name in enumerate(header)}


def fixed(study: str) -> str:
    """A study with fixed steps and signals that are held, as in an FMU."""
    sections = study.split("\n[")
    return "\n[".join(s for s in sections if not s.startswith(("estimate", "plot"))) + "\n" + FIXED


def prepare(case: str, command: Path, folder: Path) -> None:
    """``s.toml`` and ``log.csv``, with gaps where a filter bridges them."""
    example = "lee" if case == "lee" else "two-tanks"
    for model in (ROOT / "examples" / example).glob("*.mo"):
        shutil.copy(model, folder)
    study = FILTER if case == "ekf" else (ROOT / "examples" / example / "study.toml").read_text()
    deviations = "sd = true\n" if case == "ekf" else ""
    (folder / "s.toml").write_text(fixed(study) + deviations)
    run(command, folder, "simulate", "s.toml", "-q", "--log", "whole.csv", "-o", "run.csv")
    rows = (folder / "whole.csv").read_text().splitlines()[:202]
    if case == "ekf":
        place = rows[0].split(",").index("level")
        for row in (40, 41, 42, 90, 150):
            cells = rows[row].split(",")
            cells[place] = ""
            rows[row] = ",".join(cells)
    (folder / "log.csv").write_text("\n".join(rows) + "\n")
    run(command, folder, "estimate", "s.toml", "log.csv", "-q", "-o", "estimates.csv")


class Tool:
    """An FMU under way, in either version of the standard."""

    def __init__(self, file: Path, start: float) -> None:
        self.model = fmpy.read_model_description(str(file))
        self.places = {v.name: v.valueReference for v in self.model.modelVariables}
        self.is_three = self.model.fmiVersion.startswith("3")
        make = fmi3.FMU3Slave if self.is_three else fmi2.FMU2Slave
        self.fmu = make(
            guid=self.model.guid,
            unzipDirectory=fmpy.extract(str(file)),
            modelIdentifier=self.model.coSimulation.modelIdentifier,
            instanceName="estimator",
        )
        self.fmu.instantiate()
        self.begin(start)

    def begin(self, start: float) -> None:
        if self.is_three:
            self.fmu.enterInitializationMode(startTime=start)
        else:
            self.fmu.setupExperiment(startTime=start)
            self.fmu.enterInitializationMode()

    def set(self, values: dict[str, float]) -> None:
        places = [self.places[name] for name in values]
        call = self.fmu.setFloat64 if self.is_three else self.fmu.setReal
        call(places, list(values.values()))

    def get(self, names: list[str]) -> list[float]:
        call = self.fmu.getFloat64 if self.is_three else self.fmu.getReal
        values: list[float] = call([self.places[name] for name in names])
        return values

    def step(self, start: float, end: float) -> None:
        self.fmu.doStep(currentCommunicationPoint=start, communicationStepSize=end - start)

    def close(self) -> None:
        self.fmu.terminate()
        self.fmu.freeInstance()


@pytest.fixture(params=["two-tanks", "lee", "ekf"])
def case(request: pytest.FixtureRequest, command: Path, tmp_path: Path) -> Iterator[str]:
    prepare(request.param, command, tmp_path)
    yield request.param


def exported(command: Path, folder: Path, version: int) -> Path:
    told = run(command, folder, "export", "s.toml", "--to", "fmu", "--fmi", str(version), "-o", f"fmi{version}")
    assert "sources only" not in told
    (file,) = (folder / f"fmi{version}").glob("*.fmu")
    assert validation.validate_fmu(str(file)) == []
    return file


def samples(log: dict[str, np.ndarray[Any, Any]], tool: Tool) -> list[tuple[float, dict[str, float]]]:
    names = [v.name for v in tool.model.modelVariables if v.causality == "input"]
    return [(t, {name: log[name][row] for name in names}) for row, t in enumerate(log["t"])]


# all by the newer version, of each folder one by the older
@pytest.mark.parametrize(
    ("study", "version"),
    [(study, 3) for study in EXAMPLES] + [(study, 2) for study in EXAMPLES if study.endswith("/study.toml")],
)
def test_examples_are_valid(command: Path, study: str, version: int, tmp_path: Path) -> None:
    """And a compiler takes their sources; what it makes of some is run by other tests."""
    arguments = ["export", study, "--to", "fmu", "--fmi", str(version), "-o", str(tmp_path / "fmu")]
    no_compiler = {**os.environ, "PATH": str(tmp_path)}
    done = subprocess.run(
        [command, *arguments], cwd=ROOT, env=no_compiler, capture_output=True, text=True, check=False
    )
    if done.returncode != 0:
        # what has no estimator without a log is refused, and then there is nothing
        assert done.stderr.startswith("error: ") and not (tmp_path / "fmu").exists()
        return
    (file,) = (tmp_path / "fmu").glob("*.fmu")
    assert validation.validate_fmu(str(file)) == []
    with zipfile.ZipFile(file) as archive:
        archive.extractall(tmp_path)
    sources = sorted((tmp_path / "sources").glob("*.c"))
    subprocess.run([COMPILER, "-std=c99", "-fsyntax-only", *sources], check=True)


@pytest.mark.parametrize("version", [2, 3])
def test_steps_give_what_estimate_gives(case: str, command: Path, tmp_path: Path, version: int) -> None:
    log, expected = table(tmp_path / "log.csv"), table(tmp_path / "estimates.csv")
    tool = Tool(exported(command, tmp_path, version), log["t"][0])
    names = [v.name for v in tool.model.modelVariables if v.causality == "output"]
    rows, kept, later, past = samples(log, tool), None, [], None
    for row, (t, inputs) in enumerate(rows):
        if row == 1:
            tool.fmu.exitInitializationMode()
        if past is not None:
            tool.step(past, t)
        tool.set(inputs)
        past = t
        values = tool.get(names)
        np.testing.assert_allclose(values, [expected[name][row] for name in names], rtol=1e-9, atol=1e-9)
        if row == 100:
            kept = tool.fmu.getFMUState()
        if row > 100:
            later.append(values)
    # the same again, from the state itself and from its bytes
    saved = tool.fmu.serializeFMUState(kept)
    for state in (kept, tool.fmu.deserializeFMUState(saved)):
        tool.fmu.setFMUState(state)
        past = rows[100][0]
        for row, (t, inputs) in enumerate(rows[101:]):
            tool.step(past, t)
            tool.set(inputs)
            assert tool.get(names) == later[row]
            past = t
        tool.fmu.freeFMUState(state)
    tool.close()


@pytest.mark.parametrize("version", [2, 3])
def test_simulate_fmu_gives_what_estimate_gives(case: str, command: Path, tmp_path: Path, version: int) -> None:
    if case == "ekf" and version == 2:
        pytest.skip("without event mode FMPy records a filter's predictions only")
    log, expected = table(tmp_path / "log.csv"), table(tmp_path / "estimates.csv")
    file = exported(command, tmp_path, version)
    model = fmpy.read_model_description(str(file))
    inputs = [v.name for v in model.modelVariables if v.causality == "input"]
    signals = np.array(
        list(zip(log["t"], *(log[name] for name in inputs), strict=True)),
        dtype=[("time", float), *((name, float) for name in inputs)],
    )
    result = fmpy.simulate_fmu(
        str(file),
        start_time=log["t"][0],
        stop_time=log["t"][-1],
        output_interval=log["t"][1] - log["t"][0],
        input=signals,
        use_event_mode=version == 3,
    )
    for name in result.dtype.names[1:]:
        # in event mode the last value at a time is the one with its sample
        values = [result[name][np.abs(result["time"] - t) < 1e-9][-1] for t in log["t"]]
        size = np.max(np.abs(expected[name]))
        assert np.max(np.abs(values - expected[name])) <= 1e-6 * size, name


@pytest.mark.parametrize("version", [2, 3])
def test_after_a_step_no_sensor_has_reported(command: Path, tmp_path: Path, version: int) -> None:
    prepare("ekf", command, tmp_path)
    log = table(tmp_path / "log.csv")
    tool = Tool(exported(command, tmp_path, version), log["t"][0])
    rows, names = samples(log, tool), ["upper_hat", "pump_hat", "lower_sd"]
    tool.set(rows[0][1])
    tool.fmu.exitInitializationMode()
    for (past, _), (t, inputs) in zip(rows[:30], rows[1:31], strict=True):
        tool.step(past, t)
        predicted = tool.get(names)
        tool.set(dict.fromkeys(inputs, float("nan")))
        assert tool.get(names) == predicted
        tool.set(inputs)
        assert tool.get(names) != predicted
    tool.close()


def test_starts_can_be_set(command: Path, tmp_path: Path) -> None:
    prepare("ekf", command, tmp_path)
    for version in (2, 3):
        tool = Tool(exported(command, tmp_path, version), 0.0)
        tool.set({"upper_start": 1.25, "level": float("nan")})
        assert tool.get(["upper_start", "upper_hat"]) == [1.25, 1.25]
        tool.fmu.exitInitializationMode()
        with pytest.raises(Exception, match="(?i)fmi[23]Set"):
            tool.set({"upper_start": 2.0})
        with pytest.raises(Exception, match="(?i)fmi[23]Set"):
            tool.set({"upper_hat": 2.0})
        tool.fmu.reset()
        tool.begin(0.0)
        assert tool.get(["upper_start"]) == [3.99]
        tool.fmu.exitInitializationMode()
        tool.close()


def theta(study: str, value: float, more: str = "") -> str:
    """The two tanks' study with another θ."""
    assert "theta = 0.09 " in study
    return study.replace("theta = 0.09 ", f"theta = {value} {more}")


@pytest.mark.parametrize("version", [2, 3])
def test_theta_can_be_changed(command: Path, tmp_path: Path, version: int) -> None:
    """From the start on, and on the way, where `transient` says the same."""
    prepare("two-tanks", command, tmp_path)
    log, study = table(tmp_path / "log.csv"), (tmp_path / "s.toml").read_text()
    middle = log["t"][100]
    file = exported(command, tmp_path, version)
    later = f"\ntransient = {{ theta = 0.09, until = {middle} }}\n"
    for name, text in (("from_start", theta(study, 0.05)), ("later", theta(study, 0.05, later))):
        (tmp_path / f"{name}.toml").write_text(text)
        run(command, tmp_path, "estimate", f"{name}.toml", "log.csv", "-q", "-o", f"{name}.csv")
    for name, change in (("estimates", None), ("from_start", log["t"][0]), ("later", middle)):
        expected = table(tmp_path / f"{name}.csv")
        tool, past, kept = Tool(file, log["t"][0]), None, None
        (parameter,) = (v for v in tool.model.modelVariables if v.variability == "tunable")
        assert (parameter.name, parameter.causality, float(parameter.start)) == ("theta", "parameter", 0.09)
        assert float(parameter.min) > 0 and "guaranteed" in parameter.description
        names = [v.name for v in tool.model.modelVariables if v.causality == "output"]
        for row, (t, inputs) in enumerate(samples(log, tool)):
            if past is not None:
                tool.step(past, t)
            tool.set(inputs)
            if t == change:
                tool.set({"theta": 0.05})
                for wrong in (0.0, -1.0, float("nan"), float("inf")):
                    with pytest.raises(Exception, match="(?i)fmi[23]Set"):
                        tool.set({"theta": wrong})
            if row == 0:
                tool.fmu.exitInitializationMode()
            if row == 120:
                # a state of the FMU has the number, too
                kept = tool.fmu.getFMUState()
                tool.set({"theta": 1.0})
                tool.fmu.setFMUState(tool.fmu.deserializeFMUState(tool.fmu.serializeFMUState(kept)))
            wanted = [expected[name][row] for name in names]
            np.testing.assert_allclose(tool.get(names), wanted, rtol=1e-9, atol=1e-9)
            past = t
        assert tool.get(["theta"]) == [0.09 if change is None else 0.05]
        tool.fmu.reset()
        tool.begin(0.0)
        assert tool.get(["theta"]) == [0.09]
        tool.close()
