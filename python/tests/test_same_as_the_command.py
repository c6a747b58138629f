"""Every number of the command is that of Python: one engine, on all examples."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import lynkeus

from conftest import ROOT
from tank_study import TEXT

parquet = pytest.importorskip("pyarrow.parquet")

STUDIES = sorted(p.relative_to(ROOT).as_posix() for p in (ROOT / "examples").glob("*/*.toml"))

#: of reports that are told the study's path, or take time
UNLIKE = {"next", "seconds_per_sample"}


def run(command: Path, *arguments: str) -> tuple[int, str]:
    """The exit code, and what is printed: the error where there is no result."""
    done = subprocess.run([command, *arguments], cwd=ROOT, capture_output=True, text=True, check=False)
    return done.returncode, done.stdout or done.stderr


def without(value: Any) -> Any:
    if isinstance(value, dict):
        return {k: without(v) for k, v in value.items() if k not in UNLIKE}
    return [without(v) for v in value] if isinstance(value, list) else value


@pytest.fixture(autouse=True)
def in_root(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(ROOT)
    warnings.simplefilter("ignore", lynkeus.NotCredible)


@pytest.mark.parametrize("study", STUDIES)
def test_reports(command: Path, study: str) -> None:
    loaded = lynkeus.Study.load(study)
    for name in ("check", "design"):
        code, text = run(command, name, "--json", study)
        try:
            answer = getattr(loaded, name)()
        except lynkeus.LynkeusError as error:
            assert (code, text) == (exit_code(error), f"error: {error}\n")
            continue
        assert without(answer.summary) == without(json.loads(text))


def shorter(study: str, folder: Path) -> str:
    """The study with a tenth of its run, beside its model."""
    for model in (ROOT / study).parent.glob("*.mo"):
        shutil.copy(model, folder)
    text = (ROOT / study).read_text(encoding="utf-8")
    text = re.sub(r"(?m)^until = ([^\s#]+)", lambda until: f"until = {float(until[1]) / 10}", text)
    (folder / "study.toml").write_text(text, encoding="utf-8")
    return str(folder / "study.toml")


@pytest.mark.parametrize("study", STUDIES)
def test_runs(command: Path, study: str, tmp_path: Path) -> None:
    study = shorter(study, tmp_path)
    loaded = lynkeus.Study.load(study)
    if "[simulate]" not in loaded.text:
        pytest.skip("it simulates nothing")
    # with all digits
    file, log = tmp_path / "run.parquet", tmp_path / "log.parquet"
    code, text = run(command, "simulate", study, "--json", "-q", "-o", str(file), "--log", str(log))
    same(loaded.simulate(), code, text, file)
    # a log by its path, and as columns: both are what the command reads
    code, text = run(command, "estimate", study, str(log), "--json", "-q", "-o", str(file))
    try:
        replayed = loaded.estimate(log)
    except lynkeus.LynkeusError as error:
        assert (code, text) == (exit_code(error), f"error: {error}\n")
        return
    same(replayed, code, text, file)
    columns = parquet.read_table(log).to_pydict()
    assert list(columns) == lynkeus.Log.load(str(log)).headers()
    assert loaded.estimate(columns).summary["final"] == json.loads(text)["final"]


def test_fits(command: Path, tmp_path: Path) -> None:
    (tmp_path / "tank.mo").write_text(TEXT, encoding="utf-8")
    study, log, file = tmp_path / "study.toml", tmp_path / "log.parquet", tmp_path / "fit.parquet"
    study.write_text(
        'plant = "tank.mo"\n[sensors]\nnoise = { y = 0.1 }\n[observer]\nfamily = "ekf"\n'
        '[simulate]\nuntil = 20\noutput_step = 0.5\ninputs = { inflow = 1.2 }\n'
        '[fit]\nnoise = true\ninitial = ["level"]\n',
        encoding="utf-8",
    )
    loaded = lynkeus.Study.load(study)
    code, _ = run(command, "simulate", str(study), "-q", "-o", str(file), "--log", str(log))
    assert code == 0
    fit = loaded.fit(log)
    code, text = run(command, "fit", str(study), str(log), "--json", "-q", "--write", "-o", str(file))
    same(fit, code, text, file)
    assert fit.study().text == study.read_text(encoding="utf-8") != loaded.text


def exit_code(error: lynkeus.LynkeusError) -> int:
    return 2 if isinstance(error, lynkeus.InputError) else 1


def same(run: lynkeus.Run | lynkeus.Fit, code: int, text: str, file: Path) -> None:
    assert run.is_credible == (code == 0)
    told = json.loads(text)
    told.pop("written", None)
    assert without(run.summary) == without(told)
    written = parquet.read_table(file)
    assert written.column_names == run.columns
    for name in run.columns:
        np.testing.assert_array_equal(written[name].to_numpy(), run[name], err_msg=name)
