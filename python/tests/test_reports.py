"""What answers hold is declared: every key of their JSON, with its type."""

from __future__ import annotations

import json
import pickle
import runpy
import warnings
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import ROOT
from declared import strangers
from tank_study import MODEL, SIMULATE, log, tank

import lynkeus
from lynkeus import reports
from lynkeus._records import Named, Record, entries_of
from lynkeus.results import Answer

#: what takes seconds is left out
LONG = {"column", "quadrotor", "germani-manes"}
STUDIES = sorted(path for path in (ROOT / "examples").glob("*/*.toml") if path.parent.name not in LONG)
ASKED: dict[str, Callable[[lynkeus.Study], Answer]] = {
    "check": lambda study: study.check(parameters=True, about="time", time_limit=2),
    "design": lambda study: study.design(time_limit=2),
    "certify": lambda study: study.certify(time_limit=2),
    "how_well": lambda study: study.how_well(sensors="outputs", time_limit=2),
    "simulate": lambda study: study.simulate(time_limit=2),
    "runs": lambda study: study.simulate(runs=2, time_limit=2),
}


def test_the_file_is_what_the_schema_makes() -> None:
    generator = runpy.run_path(str(ROOT / "python" / "reports.py"))
    schema = json.loads((ROOT / "docs" / "answers.schema.json").read_text(encoding="utf-8"))
    written = (ROOT / "python" / "lynkeus" / "reports.py").read_text(encoding="utf-8")
    assert written == generator["text"](schema), "python python/reports.py writes it again"


def odd(answer: Answer) -> list[str]:
    """What of an answer is not declared, or is of another type than declared."""
    hint = type(answer.summary)
    assert hint is not Record and json.loads(answer.to_json()) == answer.summary
    return [*strangers(hint, json.loads(answer.to_json()), hint.__name__), *others(hint, answer.summary, "summary")]


def others(hint: Any, value: Any, path: str) -> Iterator[str]:
    """Objects that are not of a declared class."""
    if isinstance(value, dict):
        if type(value) is Record:
            yield f"{path}: of no declared class"
        for name, each in value.items():
            yield from others(None, each, f"{path}.{name}")
    if isinstance(value, list):
        for each in value:
            yield from others(None, each, f"{path}[]")


@pytest.mark.parametrize("path", STUDIES, ids=lambda path: f"{path.parent.name}-{path.stem}")
def test_shipped_examples_answer_as_declared(path: Path) -> None:
    study, answered = lynkeus.Study.load(path), 0
    for name, ask in ASKED.items():
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                answer = ask(study)
        except lynkeus.LimitError:  # on a busy machine
            answered += 1
            continue
        except (lynkeus.RefusedError, lynkeus.InputError):
            continue
        assert not odd(answer), name
        answered += 1
    assert answered >= 2


def test_logs_and_sweeps_answer_as_declared() -> None:
    folder = ROOT / "examples" / "two-tanks"
    for file in ("study.toml", "smoothed.toml"):
        study = lynkeus.Study.load(folder / file)
        assert not odd(study.estimate(folder / "log.csv"))
        assert not odd(study.compare(folder / "log.csv"))
    swept = lynkeus.Study.load(folder / "study.toml").replace(tune={"keys": {"theta": [0.02, 0.03]}})
    assert not odd(swept.tune(folder / "log.csv"))
    assert not odd(swept.compare())
    fitted = tank(observer="ekf", noise={"y": 0.01}, process_noise={"inflow": 0.1}, fit={"noise": True, "held_out": 0.25})
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", lynkeus.LogWarning)
        assert not odd(fitted.fit([log(), log(80)]))


def test_what_is_rare_answers_as_declared() -> None:
    noisy = lynkeus.Study(
        MODEL,
        unknown=["inflow"],
        noise={"y": 1e-3},
        process_noise={"inflow": 1e-6, "level": 1e-9},
        observer={"family": "ekf", "gate": 4.0},
        estimate={"sd": True},
        simulate=SIMULATE,
    )
    readings = 4.0 + np.random.default_rng(1).normal(size=200)
    readings[50:120] = readings[49]
    with pytest.warns(lynkeus.NotCredible):
        doubted = noisy.estimate({"t": np.arange(200.0), "y": readings, "level": readings})
    assert not odd(doubted) and doubted.doubts and doubted.frozen
    assert doubted.frozen[0].since == doubted.frozen[0]["from"]
    for answer in (noisy.simulate(), noisy.simulate(runs=2), noisy.how_well(sensors="all"), noisy.check()):
        assert not odd(answer)
    for answer in (noisy.compare(), noisy.replace(observer=None, process_noise=None, noise=None).check()):
        assert not odd(answer)
    swept = tank(simulate=SIMULATE, tune={"keys": {"theta": [1.0, 2.0]}}).tune()
    assert not odd(swept) and swept.rows[0].values_of_keys == {"theta": 1.0}
    assert not odd(lynkeus.Study(MODEL, observer={"family": "triangular", "theta": 2.0}).certify())


def test_the_test_finds_what_is_not_declared() -> None:
    told = json.loads(tank(simulate=SIMULATE).simulate().to_json())
    told["nix"] = 3
    told["errors"]["level"]["peak"] = "high"
    del told["errors"]["level"]["peak_at"]
    told["credible"] = None
    found = "\n".join(strangers(reports.RunReport, told, "run"))
    for words in ("run.nix: not declared", "peak: 'high'", "no peak_at", "run.credible: null"):
        assert words in found


def test_live_estimators_answer_as_declared() -> None:
    estimator = tank(observer="ekf", noise={"y": 0.01}, process_noise={"inflow": 0.1}).estimator()
    estimator.update(0.0, {"y": 4.0})
    estimator.update(0.5, {"y": None})
    health, innovation = estimator.health, estimator.innovations["y"]
    assert set(health) == set(reports.Health.__annotations__)
    assert set(health["sensors"]["y"]) == set(reports.SensorHealth.__annotations__)
    assert set(innovation) == set(reports.Innovation.__annotations__)
    assert innovation["reading"] == "missing" and health["sensors"]["y"]["missing"] == 1


def test_entries_are_attributes_of_their_classes() -> None:
    run = tank(simulate=SIMULATE).simulate()
    assert type(run.final) is Named and type(run.errors["level"]) is reports.QuantityError
    assert run.final.level == run.final["level"] == run.summary["final"]["level"]
    check = tank().check()
    proved = next(c for family in check.families for c in family.checks if c.verdict == "proved")
    assert proved.witness is None and "witness" not in proved
    with pytest.raises(AttributeError, match="no entry 'verdct' .did you mean 'verdict'"):
        proved.verdct  # type: ignore[attr-defined]
    again = pickle.loads(pickle.dumps(run.summary))
    assert again == run.summary and type(again) is reports.RunReport
    assert pickle.loads(pickle.dumps(run)).errors == run.errors


def test_every_class_is_exported_and_declares_entries() -> None:
    for name in reports.__all__:
        kind = getattr(reports, name)
        if isinstance(kind, type) and issubclass(kind, Record) and kind not in (Record, Named):
            assert entries_of(kind), name


def test_a_row_that_was_refused_says_so() -> None:
    study = tank(simulate=SIMULATE, compare=["triangular", "unknown-input"])
    compared = study.compare()
    assert not odd(compared)
    assert compared["unknown-input"].refused and compared["triangular"].refused is None
    with pytest.raises(AttributeError, match="there are family, refused"):
        compared["unknown-input"].rms


def test_logs_of_the_tank_are_as_declared() -> None:
    assert not odd(tank().estimate(log()))
