"""The notebooks, as scripts: what they claim is asserted in them."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

import lynkeus

from conftest import ROOT

pytest.importorskip("matplotlib")

NOTEBOOKS = sorted((ROOT / "notebooks").glob("*.py"))


@pytest.mark.parametrize("notebook", NOTEBOOKS, ids=lambda path: path.stem)
def test_notebook(notebook: Path) -> None:
    package = Path(lynkeus.__file__).parents[1]
    path = os.pathsep.join(filter(None, [str(package), os.environ.get("PYTHONPATH")]))
    ended = subprocess.run(
        [sys.executable, "-W", "error::RuntimeWarning", notebook],
        cwd=ROOT,
        env={**os.environ, "MPLBACKEND": "Agg", "PYTHONPATH": path},
        capture_output=True,
        text=True,
        check=False,
    )
    assert ended.returncode == 0, ended.stderr
    for line in ended.stdout.splitlines():
        if line.startswith("skipped"):
            pytest.skip(line)


def test_they_are_here() -> None:
    names = {path.stem for path in NOTEBOOKS}
    assert names >= {"cell", "five_papers", "measured_pipe", "two_tanks", "why_not_just_an_ekf"}
