"""What the README and docs/python.md show in Python runs, block after block."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import lynkeus
from conftest import ROOT

#: sections of others, which need more than NumPy and matplotlib
OTHERS = re.compile(r"^## (Models from functions|Elsewhere)", re.MULTILINE)


def blocks(page: str) -> list[str]:
    text = OTHERS.split((ROOT / page).read_text(encoding="utf-8"))[0]
    return re.findall(r"^```python\n(.*?)^```$", text, re.MULTILINE | re.DOTALL)


@pytest.fixture
def in_a_copy(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    (tmp_path / "examples").symlink_to(ROOT / "examples")
    monkeypatch.chdir(tmp_path)
    matplotlib = pytest.importorskip("matplotlib")
    matplotlib.use("Agg")
    yield
    from matplotlib import pyplot

    pyplot.close("all")


@pytest.mark.usefixtures("in_a_copy")
@pytest.mark.parametrize("page", ["README.md", "docs/python.md"])
def test_blocks_run(page: str) -> None:
    names: dict[str, object] = {"__name__": page}
    assert blocks(page)
    for block in blocks(page):
        exec(compile(block, page, "exec"), names)


@pytest.mark.usefixtures("in_a_copy")
def test_optimisers_and_samplers_end_where_the_fit_does() -> None:
    for needed in ("scipy", "jax", "emcee"):
        pytest.importorskip(needed)
    text = (ROOT / "docs/python.md").read_text(encoding="utf-8")
    names: dict[str, Any] = {"lynkeus": lynkeus}
    for title in ("## Fitting to logs", "### A likelihood for optimisers and samplers"):
        section = re.split(r"^##", text.split(f"\n{title}\n")[1], flags=re.MULTILINE)[0]
        for block in re.findall(r"^```python\n(.*?)^```$", section, re.MULTILINE | re.DOTALL):
            exec(compile(block, title, "exec"), names)
    fit, theta = names["fit"], names["ended"].x
    sd = np.array([fit.parameters["k"].sd, fit.noise["y"].sd])
    np.testing.assert_allclose(theta, names["theta"], rtol=1e-5)
    np.testing.assert_allclose(names["sd"], sd, rtol=1e-3)
    np.testing.assert_allclose(names["slopes"] / theta, names["likelihood"].gradient(theta), rtol=1e-6)
    np.testing.assert_allclose(names["sample"].std(axis=0), sd, rtol=0.1)


@pytest.mark.usefixtures("in_a_copy")
def test_the_readme_draws_its_picture() -> None:
    exec(compile(blocks("README.md")[0], "README.md", "exec"), {})
    drawn = Path("estimates.svg").read_text(encoding="utf-8")
    shipped = (ROOT / "docs" / "pictures" / "two-tanks-smoothed.svg").read_text(encoding="utf-8")
    assert len(curves(drawn)) > 10 and curves(drawn) == curves(shipped)


def curves(svg: str) -> list[str]:
    return re.findall(r'points="([^"]*)"', svg)
