"""Type checkers find a user's mistakes where Python would find them when it comes to them, and nothing else."""

from __future__ import annotations

import importlib.util
import json
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tank_study import MODEL, SIMULATE, log, tank

import lynkeus

WRONG = '''
import lynkeus
from lynkeus import Model, Study

model = Model.load("tank.mo")
study = Study(model, unknown=["inflow"])
run = study.estimate("log.csv")

Study(model, unknow=["inflow"])  # 1
run.erors  # 2
Study(model, observer={"famly": 3})  # 3
study.replace(obsever=3)  # 4
study.estimate(1)  # 5
run.final.upper()  # 6
run.errors.upper()  # 6
study.check().families.upper()  # 6
lynkeus.sqrt(2.0).upper()  # 7
lynkeus.sqrt("2")  # 7
Study(model, unknown="inflow")
Study(model, observer="efk")
Study(model, observer={"theta": "fast"})
Study(model, noise={"y": {"unifrom": 0.1}})
Study(model, simulate={"untill": 3.0})
study.replace(observer={"famly": "ekf"})
study.sweep([{"obsever": {"theta": 2.0}}])
study.simulate(run=3)
lynkeus.check(study, parameter=True)
lynkeus.simulate(study, runs="3")
lynkeus.estimate(study, 1)
study.check().families[0].checks[0].verdct
study.check().families[0].fit = "fit"
study.certify().certificate.rate.upper()
study.simulate().errors["level"].paek
study.simulate(runs=3).final
study.compare()["ekf"].rsm
study.tune().knee.mean_error
study.fit("a.csv").parameters["k"].sd + 1.0
study.fit(3)
study.fit(["a.csv"]).study().tune().kneee
study.how_well().standard_error["level"] + 1.0
study.estimate_each(["a.csv"])[0].erors
study.estimator().health["sensor"]
study.export("device", to="cpp")
'''

RIGHT = '''
from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import lynkeus
from lynkeus import Log, Model, Study
from lynkeus.sections import Changes, ObserverSection


def tank(t: float, x: Any, u: Any, p: Any) -> list[Any]:
    return [u.inflow - p.k * lynkeus.sqrt(x.level)]


def grid(speeds: list[float]) -> list[Changes]:
    return [{"observer": {"theta": speed}, "simulate": {"seed": place}} for place, speed in enumerate(speeds)]


def tuned(model: Model, speed: np.float64, noise: dict[str, float], names: tuple[str, ...]) -> Study:
    observer: ObserverSection = {"family": "triangular"}
    observer["theta"] = speed
    return Study(
        model,
        measured=names,
        unknown=["inflow"],
        noise=noise,
        observer=observer,
        box={"inflow": [0, 4.5], "level": np.array([0.5, 9.0])},
        simulate={"until": 20, "output_step": 0.5, "inputs": {"inflow": "if time < 5 then 1.2 else 0.8"}},
        estimate={"sd": False, "columns": {"y": "level"}},
        tune={"keys": {"theta": {"from": 1, "to": 4, "points": 3}}},
        compare=["triangular", "ekf"],
    )


model = Model.from_function(
    tank,
    states={"level": {"start": 4.0, "min": 0.1, "max": 10.0}},
    inputs={"inflow": {"min": 0.0, "max": 5.0}},
    outputs=["level"],
    params={"k": 0.5},
)
study = tuned(model, np.float64(1.0), {"level": 0.01}, ("level",))
faster = study.replace(observer={"theta": 2.0}, parameters={"k": None}, process_noise={"inflow": 1e-3})
filtered = study.replace(observer="ekf", estimate=None, noise={"level": "1%"})
placed = study.replace(observer={"family": "drift-observable", "poles": [[-1, 0.5], [-1, -0.5]], "k": np.eye(2)})
dynamic: dict[str, Any] = {"observer": {"theta": 2.0}}
other = study.replace(**dynamic)

check = study.check(about="level^2")
fits: list[str] = [family.family for family in check.families if family.fit == "fits"]
why: list[str] = [condition.detail for family in check.families for condition in family.checks]
rate: float | None = study.certify().certificate.rate
verdict: str = lynkeus.certify(study).verdict

run = study.simulate()
peak: float = run.errors.inflow.peak + run.final["inflow"] + max(run.final.values())
settled: float | None = run.errors["inflow"].settled_at
truth: NDArray[np.float64] = run["inflow"] - run["inflow_hat"]
many = study.simulate(runs=3)
worst: float | None = many.quantities["inflow"].rms_last_half.worst
replays = [study.estimate(run), study.estimate({"t": run.t, "level": run.log["level"]}), study.estimate(Path("a.csv"))]
doubts: list[str] = [doubt.text for replay in replays for doubt in replay.doubts if doubt.level == "refusal"]
frozen: list[float] = [hanging.since for replay in replays for hanging in replay.frozen]
from_log = lynkeus.estimate("study.toml", Log.load("log.csv"), time_limit=3.0)
each = study.estimate_each({"a": "a.csv", "b": "b.csv"}, keep=lambda replay: replay.final["inflow"])
by_asset: dict[Any, float] = each
swept = study.sweep(grid([1.0, 2.0]))
errors: list[float] = [one.errors["inflow"].peak for one in swept]
comparison = study.compare(run)
rms: float | None = comparison["ekf"].rms["inflow"]
knee = study.tune().knee
if knee is not None and knee.peak is not None:
    print(knee.mean_error, knee.peak.time, knee.values_of_keys["theta"])
fit = study.fit([run, {"t": run.t, "level": run.log["level"]}, Path("a.csv")], profiles=True)
k: float = fit.parameters["k"].value + fit.values["noise.level"]
white: float | None = fit.errors["level"].ljung_box
residuals: NDArray[np.float64] = lynkeus.fit("study.toml", "log.csv")["level_innovation"]
replayed = fit.study().estimate(run)
sigma = study.how_well(sensors="outputs").standard_error["inflow"]
known: float = 0.0 if sigma is None else sigma
estimator = study.estimator()
estimator.update(0.0, {"level": 4.0, "inflow": None})
missing: int = estimator.health["sensors"]["level"]["missing"]
root: float = lynkeus.sqrt(2.0) + lynkeus.maximum(1, 2.0) + abs(-1.0)
roots: NDArray[Any] = lynkeus.sqrt([1.0, 2.0]) + lynkeus.where(truth > 0, truth, 0.0)
'''


#: what Python makes of the seven
REFUSED: dict[str, tuple[Callable[[], Any], type[Exception], str]] = {
    "1": (lambda: lynkeus.Study(MODEL, unknow=["inflow"]), TypeError, "unknow"),
    "2": (lambda: tank().estimate(log()).erors, AttributeError, "did you mean 'errors'"),
    "3": (lambda: lynkeus.Study(MODEL, observer={"famly": 3}), lynkeus.InputError, "famly"),
    "4": (lambda: tank().replace(obsever=3), lynkeus.InputError, "obsever"),
    "5": (lambda: tank().estimate(1), lynkeus.ArgumentError, "expected a path, a mapping of columns"),
    "6": (lambda: tank(simulate=SIMULATE).simulate().final.upper(), AttributeError, "no entry 'upper'"),
    "7": (lambda: lynkeus.sqrt(2.0).upper(), AttributeError, "upper"),
}


def pyright(*arguments: str, folder: Path) -> dict[str, Any]:
    """What pyright reports as JSON."""
    if importlib.util.find_spec("pyright") is None:
        pytest.skip("skipped: pyright is not installed")
    package = str(Path(lynkeus.__file__).parents[1])
    path = os.pathsep.join([str(Path(sys.executable).parent), os.environ.get("PATH", "")])
    told = subprocess.run(
        [sys.executable, "-m", "pyright", "--outputjson", "--pythonpath", sys.executable, *arguments],
        capture_output=True,
        text=True,
        cwd=folder,
        # whose packages --verifytypes sees is for the PATH to say
        env={**os.environ, "PATH": path, "PYTHONPATH": package, "PYRIGHT_PYTHON_IGNORE_WARNINGS": "1"},
    )
    try:
        found: dict[str, Any] = json.loads(told.stdout)
    except json.JSONDecodeError:  # no node, and none that could be fetched
        pytest.skip(f"skipped: pyright does not run: {told.stderr.strip()[-200:]}")
    return found


def checked(text: str, folder: Path) -> dict[int, list[str]]:
    """Messages by the lines, counted from 0, that pyright has something against."""
    (folder / "user.py").write_text(text, encoding="utf-8")
    (folder / "pyrightconfig.json").write_text(json.dumps({"typeCheckingMode": "standard"}), encoding="utf-8")
    found: dict[int, list[str]] = {}
    for told in pyright("user.py", folder=folder)["generalDiagnostics"]:
        if told["severity"] == "error":
            found.setdefault(told["range"]["start"]["line"], []).append(told["message"])
    return found


def test_mistakes_are_found(tmp_path: Path) -> None:
    found, lines = checked(WRONG, tmp_path), WRONG.splitlines()
    first = lines.index("Study(model, unknow=[\"inflow\"])  # 1")
    missed = [line for place, line in enumerate(lines) if place >= first and place not in found]
    assert not missed
    assert not {place: told for place, told in found.items() if place < first}


def test_a_correct_program_is_left_alone(tmp_path: Path) -> None:
    lines = RIGHT.splitlines()
    assert not {lines[place]: told for place, told in checked(RIGHT, tmp_path).items()}


def test_results_have_types(tmp_path: Path) -> None:
    asked = {
        'run.final': "Named[float]",
        'run.errors["x"]': "QuantityError",
        "study.check().families": "list[FamilyFit]",
        "study.certify().certificate": "Proof",
        "run.is_credible": "bool",
        "run.doubts": "list[Doubt]",
        "run.innovations": "Named[InnovationCounts]",
        "study.tune().rows": "list[SweptRow]",
        "study.fit('a.csv').initial": "Named[list[FittedValue]]",
        "study.fit('a.csv').study()": "Study",
        "study.likelihood('a.csv').nll([1.0])": "float",
        "study.likelihood('a.csv').innovations([1.0])": "list[Innovations]",
        "lynkeus.sqrt(2.0)": "float",
        "lynkeus.simulate(study)": "Simulation",
        "lynkeus.simulate(study, runs=3)": "MonteCarlo",
    }
    text = 'import lynkeus\nstudy = lynkeus.Study.load("s.toml")\nrun = study.estimate("log.csv")\n'
    (tmp_path / "user.py").write_text(text + "".join(f"reveal_type({each})\n" for each in asked), encoding="utf-8")
    told = pyright("user.py", folder=tmp_path)["generalDiagnostics"]
    revealed = [each["message"].rpartition(" is ")[2].strip('"') for each in told if each["severity"] == "information"]
    assert dict(zip(asked, revealed, strict=True)) == asked


def test_every_public_name_has_a_type(tmp_path: Path) -> None:
    told = pyright("--verifytypes", "lynkeus", "--ignoreexternal", folder=tmp_path)["typeCompleteness"]
    unknown = [each["name"] for each in told["symbols"] if each["isExported"] and not each["isTypeKnown"]]
    assert told["completenessScore"] == 1, unknown


@pytest.mark.parametrize("number", REFUSED)
def test_mistakes_are_refused_at_run_time(number: str) -> None:
    call, kind, words = REFUSED[number]
    with pytest.raises(kind, match=words):
        call()


def test_the_correct_program_is_python() -> None:
    compile(RIGHT, "right", "exec")


@pytest.mark.parametrize("number", [0.5, 1, True, np.float32(0.5), np.int64(1)], ids=repr)
def test_functions_of_a_number_give_a_float(number: Any) -> None:
    pairs = {"atan2", "minimum", "maximum"}
    for name in lynkeus.functions.__all__:
        function = getattr(lynkeus, name)
        if name == "where":
            found = function(True, number, 2)
        elif name == "interp":
            found = function(number, [0, 1, 2], [3, 4, 5])
        else:
            found = function(number, number) if name in pairs else function(number)
        assert isinstance(found, float), name
        assert isinstance(lynkeus.sqrt([number, number]), np.ndarray)


def test_a_star_hides_nothing_of_pythons() -> None:
    import builtins

    assert not set(lynkeus.__all__) & set(dir(builtins))
    assert lynkeus.abs(-2.0) == 2.0
