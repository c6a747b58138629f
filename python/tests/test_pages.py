"""What the README and docs/python.md show in Python runs, block after block."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

import pytest

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
def test_the_readme_draws_its_picture() -> None:
    exec(compile(blocks("README.md")[0], "README.md", "exec"), {})
    drawn = Path("estimates.svg").read_text(encoding="utf-8")
    shipped = (ROOT / "docs" / "pictures" / "two-tanks-smoothed.svg").read_text(encoding="utf-8")
    assert len(curves(drawn)) > 10 and curves(drawn) == curves(shipped)


def curves(svg: str) -> list[str]:
    return re.findall(r'points="([^"]*)"', svg)
