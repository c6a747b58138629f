"""The package as a user meets it."""

from __future__ import annotations

import copy
import doctest
import importlib
import json
import pickle
import pkgutil
import subprocess
import sys
import time
import tomllib
from pathlib import Path

import numpy as np
import pytest
from tank_study import MODEL, SIMULATE, TEXT, tank

import lynkeus
from lynkeus import _progress

@pytest.fixture
def study() -> lynkeus.Study:
    """Without noise."""
    return tank(observer={"theta": 1.0}, simulate=SIMULATE)


def test_documentation_runs() -> None:
    for module in pkgutil.iter_modules(lynkeus.__path__):
        loaded = importlib.import_module(f"lynkeus.{module.name}")
        assert doctest.testmod(loaded).failed == 0, module.name


def test_a_study_without_files(study: lynkeus.Study) -> None:
    assert study.check().recommended == "triangular"
    run = study.simulate()
    assert run.columns == ["t", "level", "inflow", "level_hat", "inflow_hat"]
    assert abs(run["inflow_hat"][-1] - 1.2) < 1e-4
    assert run.t[1] == 0.5 and len(run) == 41
    # what was simulated is a log
    replayed = study.estimate(run)
    assert abs(replayed["inflow_hat"][-1] - 1.2) < 1e-2


def test_a_study_changes_and_travels(study: lynkeus.Study) -> None:
    faster = study.replace(observer={"theta": 2.0})
    assert faster.simulate().summary != study.simulate().summary
    assert "theta = 1.0" in study.text and "theta = 2.0" in faster.text
    twin = pickle.loads(pickle.dumps(faster))
    np.testing.assert_array_equal(twin.simulate()["inflow_hat"], faster.simulate()["inflow_hat"])


def test_changes_say_what_studies_say(study: lynkeus.Study) -> None:
    two = lynkeus.Model.from_modelica(TEXT + TEXT.replace("Tank", "Half").replace("0.5*", "0.25*"))
    both = study.replace(plant=two, model="Tank")
    first, second = both.sweep([{"model": "Tank"}, {"model": "Half"}])
    assert (first.summary["plant"], second.summary["plant"]) == ("Tank", "Half")
    np.testing.assert_array_equal(first["inflow_hat"], study.simulate()["inflow_hat"])
    noisy = study.replace(noise={"y": 0.1}, process_noise={"inflow": 1.0}, observer="ekf")
    assert noisy.simulate().summary["family"] == "ekf"
    assert "0.1" in noisy.text and 'unknown = ["inflow"]' in noisy.text
    compared = noisy.replace(compare=["ekf", "ukf"]).compare()
    assert [row["family"] for row in compared.summary["families"]] == ["ekf", "ukf"]


def test_a_study_in_newer_toml_than_pythons_changes(study: lynkeus.Study) -> None:
    text = study.text + '[estimate]\ncolumns = {\n  y = "le\\x76el",\n}\n[tune]\nkeys = { theta = [1, 2, 3e0] }\n'
    newer = lynkeus.Study.parse(text, study.model, "s.toml")
    with pytest.raises(tomllib.TOMLDecodeError):
        tomllib.loads(text)
    changed = newer.replace(observer={"theta": 2.0})
    expected = tomllib.loads(study.text) | {"observer": {"theta": 2.0}}
    expected |= {"estimate": {"columns": {"y": "level"}}, "tune": {"keys": {"theta": [1, 2, 3.0]}}}
    assert tomllib.loads(changed.text) == expected
    assert list(tomllib.loads(changed.text)) == list(expected)  # in their order


def test_a_design_tells_its_notes(examples: Path) -> None:
    answers = [lynkeus.design(examples / "two-tanks" / "study.toml"), lynkeus.design(examples / "lee" / "study.toml")]
    for answer in answers:
        certificate = answer.summary["certificate"] or {}
        assert answer.notes == [*answer.summary["notes"], *certificate.get("notes", [])]
    assert any(answer.notes for answer in answers)


def test_a_study_from_a_file_goes_without_it(tmp_path: Path) -> None:
    (tmp_path / "tank.mo").write_text(TEXT)
    (tmp_path / "s.toml").write_text('plant = "tank.mo"\n[sensors]\nunknown = ["inflow"]\n')
    study = lynkeus.Study.load(tmp_path / "s.toml")
    before, data = study.check().summary, pickle.dumps(study)
    for file in tmp_path.iterdir():
        file.unlink()
    assert pickle.loads(data).check().summary == before


def test_a_study_with_a_byte_order_mark_changes(tmp_path: Path) -> None:
    (tmp_path / "tank.mo").write_text(TEXT, encoding="utf-8-sig")
    text = 'plant = "tank.mo"\n[sensors]\nunknown = ["inflow"]\n'
    (tmp_path / "s.toml").write_text(text, encoding="utf-8-sig")
    study = lynkeus.Study.load(tmp_path / "s.toml")
    assert study.text == text and study.model.text == TEXT
    assert study.replace().check().summary == study.check().summary


def test_a_study_whose_plant_is_missing_travels(tmp_path: Path) -> None:
    (tmp_path / "s.toml").write_text('plant = "tank.mo"\n[sensors]\nunknown = ["inflow"]\n')
    study = lynkeus.Study.load(tmp_path / "s.toml")
    for twin in (study, pickle.loads(pickle.dumps(study)), study.replace(observer={"theta": 2.0})):
        with pytest.raises(lynkeus.InputError, match="no plant file at .*tank.mo"):
            twin.check()
    (tmp_path / "tank.mo").write_text(TEXT)
    assert pickle.loads(pickle.dumps(study)).check().summary == study.check().summary


def test_an_estimator_goes_on_where_its_pickle_was(study: lynkeus.Study) -> None:
    estimator = study.estimator()
    assert estimator.signals == ["y"] and estimator.names == ["level", "inflow"]
    for k in range(20):
        estimator.update(0.5 * k, {"y": None if k % 5 == 3 else 4.0})
    twins = [pickle.loads(pickle.dumps(estimator)), copy.copy(estimator)]
    for twin in [estimator, *twins]:
        twin.update(10.0, {"y": 4.1})
        twin.predict(10.5)
    assert all(twin.estimate == estimator.estimate for twin in twins)
    assert estimator.time == 10.5
    assert estimator.health["sensors"]["y"]["missing"] == 4
    np.testing.assert_array_equal(estimator.to_numpy(), list(estimator.estimate.values()))


def test_errors_say_where(study: lynkeus.Study, tmp_path: Path) -> None:
    with pytest.raises(lynkeus.InputError, match="no output named 'nix'") as caught:
        lynkeus.Study(MODEL, measured=["nix"]).check()
    assert caught.value.place is not None and caught.value.place.startswith("study:")
    copied = pickle.loads(pickle.dumps(caught.value))
    assert (str(copied), copied.place) == (str(caught.value), caught.value.place)
    with pytest.raises(lynkeus.InputError, match="no signal is called") as caught:
        study.estimator().update(0.0, {"nix": 1.0})
    with pytest.raises(TypeError, match="expected a number"):
        study.estimator().update(0.0, {"y": "four"})  # type: ignore[dict-item]
    with pytest.raises(lynkeus.InputError, match="no study file"):
        lynkeus.Study.load(tmp_path / "none.toml")
    with pytest.raises(KeyError, match="expected one of t, level"):
        study.simulate()["nix"]
    with pytest.raises(AttributeError, match="its summary has"):
        study.check().nix
    with pytest.raises(lynkeus.InputError, match="observer.theta: expected a number"):
        study.replace(observer={"theta": object()})


def test_what_is_not_credible_warns() -> None:
    filtered = lynkeus.Study(
        MODEL,
        unknown=["inflow"],
        noise={"y": 1e-3},
        process_noise={"inflow": 1e-6, "level": 1e-9},
        observer="ekf",
    )
    noisy = 4.0 + np.random.default_rng(1).normal(size=200)
    with pytest.warns(lynkeus.NotCredible):
        run = filtered.estimate({"t": np.arange(200.0), "y": noisy})
    assert not run.is_credible and isinstance(run.refusal, lynkeus.RefusedError)


def test_a_limit_is_an_exception(examples: Path) -> None:
    with pytest.raises(lynkeus.LimitError):
        lynkeus.design(examples / "column" / "study-certified.toml", time_limit=1e-3)


def test_runs_that_no_memory_holds_are_refused(study: lynkeus.Study) -> None:
    with pytest.raises(lynkeus.InputError, match="2048 MiB are left|204[0-8] MiB are left"):
        study.simulate(runs=10**11)
    with pytest.raises(lynkeus.InputError, match="memory"):
        study.simulate(runs=10**15, memory_limit=float("inf"))
    with pytest.raises(lynkeus.InputError, match="MiB are left"):
        study.simulate(runs=100_000, memory_limit=1)
    for wrong in (-1.0, float("nan")):
        with pytest.raises(ValueError, match="memory_limit: expected MiB >= 0"):
            study.simulate(memory_limit=wrong)


def test_what_others_have_in_memory_does_not_count(study: lynkeus.Study) -> None:
    held = lynkeus.Log.from_columns([("t", np.arange(1e6))])  # 8 MB of the engine's
    assert study.simulate(runs=4, memory_limit=6).completed == 4 and len(held) == 10**6


def test_progress_is_told_and_may_raise(study: lynkeus.Study) -> None:
    long = study.replace(simulate={"until": 1e5, "output_step": 1.0})
    told: list[float] = []
    long.simulate(progress=told.append)
    assert told == sorted(told) and told.count(1.0) == 1

    class Stopped(Exception):
        pass

    def stop(_: float) -> None:
        raise Stopped

    with pytest.raises(Stopped):
        long.replace(simulate={"until": 1e7}).simulate(progress=stop)


def test_the_end_is_told_once() -> None:
    for fractions in ([0.5], [0.5, 1.0], [0.5, 1.0, 1.0]):
        seen: list[float] = []
        with _progress.told(seen.append, "work") as tell:
            for fraction in fractions:
                assert tell is not None
                tell(fraction)
        assert seen == [0.5, 1.0]


def test_functions_are_those_of_the_model() -> None:
    functions = MODEL.functions()
    assert functions.states == ["level"] and functions.inputs == ["inflow"]
    assert functions.f(0.0, [4.0], [1.2]).tolist() == [1.2 - 0.5 * 2.0]
    assert functions.h(0.0, [4.0], [1.2]).tolist() == [4.0]
    with pytest.raises(lynkeus.InputError, match=r"x: expected 1 values \(level\), found 2"):
        functions.f(0.0, [4.0, 1.0], [1.2])


def test_slopes_are_there_after_the_time_is_over(study: lynkeus.Study) -> None:
    functions = study.observer(time_limit=0.5)
    time.sleep(0.6)
    slopes = functions.jacobian_x(0.0, [4.0, 1.0], [4.1])
    assert np.isfinite(slopes).all()
    np.testing.assert_array_equal(slopes, study.observer().jacobian_x(0.0, [4.0, 1.0], [4.1]))
    with pytest.raises(lynkeus.LimitError):
        study.observer(time_limit=0.0)


def test_columns_are_the_same_one_by_one_and_together(study: lynkeus.Study) -> None:
    answers: list[lynkeus.results.Table] = [study.simulate(runs=3), study.how_well()]
    answers.append(study.replace(tune={"keys": {"theta": [1.0, 2.0]}}).tune())
    for answer in answers:
        table = np.asarray(answer)
        assert table.shape == (len(answer), len(answer.columns)) and len(answer) > 0
        for place, name in enumerate(answer.columns):
            np.testing.assert_array_equal(table[:, place], answer[name])
        assert answer._core.column(len(answer.columns)) is None


def test_the_package_has_the_command_inside(tmp_path: Path) -> None:
    def run(*arguments: str) -> subprocess.CompletedProcess[str]:
        words = [sys.executable, "-m", "lynkeus", *arguments]
        return subprocess.run(words, cwd=tmp_path, capture_output=True, text=True, check=False)

    assert run("--version").stdout == f"lynkeus {lynkeus.__version__}\n"
    (tmp_path / "tank.mo").write_text(TEXT)
    (tmp_path / "s.toml").write_text('plant = "tank.mo"\n[sensors]\nunknown = ["inflow"]\n')
    asked = run("check", "s.toml", "--json")
    answer, ours = json.loads(asked.stdout), lynkeus.check(tmp_path / "s.toml").summary
    assert asked.returncode == 0 and answer["families"] == ours["families"]
    assert list(answer)[0] == "lynkeus" and answer["lynkeus"] == ours["lynkeus"] == lynkeus.__version__
    missing = run("check", "none.toml")
    assert (missing.returncode, missing.stdout) == (2, "") and "no study file" in missing.stderr
