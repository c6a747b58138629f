"""The pages do what they show: their blocks run in order, what they print is what stands there, and fragments can be read.

A page says where blocks run: ``<!-- starts in an empty folder -->``, ``<!-- starts in a copy of examples/two-tanks -->`` or
``<!-- starts in a clone -->``; where it says so again, a new folder begins. There ``sh`` and ``python`` blocks run, and a
``text`` block right behind one is its output, in which a line ``…`` stands for any number of lines. A block with
``title="NAME"`` is a file that the reader saves. Any other block is a fragment, read by what reads its language. What
readers need not see stands in a comment with a block of its own.

A block after ``<!-- kept as NAME -->`` is a part of what a test of the command keeps in its folder ``said``, a command or what it printed.
A block after ``<!-- not run: why -->`` is left alone; there are few of them. ``LYNKEUS_WRITE_DOCS=1`` writes outputs
without ``…`` anew.
"""

from __future__ import annotations

import configparser
import contextlib
import io
import json
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

import lynkeus
from conftest import ROOT

SAID = ROOT / "crates/lynkeus-cli/tests/command/said"
#: the blocks of this page are made, and compared, by a test of the command
MADE = ROOT / "docs/commands.md"
#: not those for people who work on Lynkeus, whose commands build and measure for minutes
FOUND = sorted(page for pattern in ("README.md", "docs/*.md", "docs/*/*.md", "examples/**/*.md") for page in ROOT.glob(pattern))
#: how many blocks may be left out
LEFT_OUT = 16

BLOCK = re.compile(r"^(<!-- (not run:|kept as) ([^\n]+) -->\n)?```(\w*)([^\n]*)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
START = re.compile(r"^<!-- starts in (an empty folder|a clone|a copy of (\S+)) -->$", re.MULTILINE)
TITLE = re.compile(r'title="([^"]+)"')
NUMBER = re.compile(r"(?<![\w.])[-+]?\d+\.\d+(?:e[-+]?\d+)?")
#: what is of one machine
OURS = re.compile(r"\d+(\.\d+)? (s|ms|µs)\b")
#: the picture that a page shows of what it draws as `estimates.svg`, by where it starts
SHOWN = {
    ("docs/tutorials/own-tank", "an empty folder"): "own-tank.svg",
    ("README", "a clone"): "two-tanks-smoothed.svg",
    ("examples/two-tanks/README", "a clone"): "two-tanks.svg",
}
WRITES = "LYNKEUS_WRITE_DOCS" in os.environ


def pages() -> list[Path]:
    """Those with blocks."""
    return [page for page in FOUND if page != MADE and BLOCK.search(page.read_text(encoding="utf-8"))]


def name_of(page: Path) -> str:
    return page.relative_to(ROOT).with_suffix("").as_posix()


@pytest.fixture
def shell(command: Path, tmp_path: Path) -> dict[str, str]:
    """An environment in which ``lynkeus`` is the command of the same sources."""
    folder = tmp_path / "bin"
    folder.mkdir()
    (folder / "lynkeus").symlink_to(command)
    python = Path(sys.executable).parent
    path = os.pathsep.join([str(folder), str(python), os.environ["PATH"]])
    return {**os.environ, "PATH": path, "NO_COLOR": "1", "LC_ALL": "C.UTF-8"}


@pytest.fixture(autouse=True)
def without_windows(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    monkeypatch.setenv("MPLBACKEND", "Agg")
    yield
    if pyplot := sys.modules.get("matplotlib.pyplot"):
        pyplot.close("all")


@pytest.mark.skipif(os.name == "nt", reason="the pages are for a POSIX shell")
@pytest.mark.parametrize("page", pages(), ids=name_of)
def test_page(page: Path, shell: dict[str, str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PATH", shell["PATH"])
    names = Reader(page, shell, tmp_path, monkeypatch).read()
    if page == ROOT / "docs/python.md":
        optimisers_and_samplers_end_where_the_fit_does(names)


def test_few_blocks_are_left_out() -> None:
    blocks = [block for page in FOUND for block in BLOCK.finditer(page.read_text(encoding="utf-8"))]
    left_out = [block[1] for block in blocks if block[2] == "not run:"]
    assert len(blocks) > 100
    assert len(left_out) <= LEFT_OUT, "".join(left_out)


@pytest.mark.parametrize("page", FOUND, ids=name_of)
def test_no_block_is_hidden_by_its_indentation(page: Path) -> None:
    text = BLOCK.sub("", page.read_text(encoding="utf-8"))
    assert not re.findall(r"\n\n {4}\S.*", text), "a fence says what it is"


class Reader:
    """Who follows a page: in which folder, with which names in Python, and what was printed last."""

    def __init__(self, page: Path, shell: dict[str, str], room: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        self.page, self.shell, self.room, self.monkeypatch = page, shell, room, monkeypatch
        self.text = page.read_text(encoding="utf-8")
        self.folder: Path | None = None
        self.where = ""
        self.names: dict[str, Any] = {}
        self.printed: str | None = None

    def read(self) -> dict[str, Any]:
        """Goes through the page; the names that Python has in the end."""
        written, end = "", 0
        for block in BLOCK.finditer(self.text):
            between = self.text[end : block.start()]
            for start in START.finditer(between):
                self.begin(start)
            if between.replace("-->", "").strip():
                self.printed = None
            written += between + self.block(block)
            end = block.end()
        self.compare_pictures()
        if WRITES:
            self.page.write_text(written + self.text[end:], encoding="utf-8")
        return self.names

    def begin(self, start: re.Match[str]) -> None:
        """A new folder."""
        self.compare_pictures()
        self.where = start[1]
        self.folder = self.room / f"work-{len(list(self.room.iterdir()))}"
        if start[2]:
            shutil.copytree(ROOT / start[2], self.folder)
        else:
            self.folder.mkdir()
        if start[1] == "a clone":
            shutil.copytree(ROOT / "examples", self.folder / "examples")
        self.monkeypatch.chdir(self.folder)
        self.names, self.printed = {"__name__": self.page.stem}, None

    def block(self, block: re.Match[str]) -> str:
        """Does what a block says; the block as it should be."""
        comment, remark, said, language, info, body = block.groups()
        printed, self.printed = self.printed, None
        if remark == "not run:":
            return block[0]
        if remark == "kept as":
            kept = (SAID / f"{said}.txt").read_text(encoding="utf-8")
            body = f"$ {body}" if language == "sh" else body
            assert f"\n{alike(body)}" in f"\n{alike(kept)}", f"{self.page.name} shows\n{body}\nwhich is not in {said}.txt"
            return block[0]
        if language == "text":
            assert printed is not None, f"{self.page.name}: nothing runs before\n{body}"
            if WRITES and "\n…\n" not in f"\n{body}" and not matches(body, printed):
                body = printed
            assert matches(body, printed), f"{self.page.name} shows\n{body}\nand it prints\n{printed}"
            return f"```text{info}\n{body}```"
        if title := TITLE.search(info):
            path = self.here() / title[1]
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(body, encoding="utf-8")
        elif language == "sh":
            self.printed = self.run(body)
        elif language == "python":
            out = io.StringIO()
            self.here()
            with contextlib.redirect_stdout(out):
                exec(compile(body, self.page.name, "exec"), self.names)
            self.printed = out.getvalue()
        else:
            assert language in FRAGMENTS, f"{self.page.name}: nobody reads a block of {language or 'no language'}\n{body}"
            FRAGMENTS[language](body, self.room)
        return block[0]

    def here(self) -> Path:
        assert self.folder, f"{self.page.name} does not say where it starts"
        return self.folder

    def run(self, script: str) -> str:
        done = subprocess.run(
            ["bash", "-ec", script],
            cwd=self.here(),
            env=self.shell,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            check=False,
        )
        assert done.returncode == 0, f"{self.page.name}:\n{script}\n{done.stdout}"
        return done.stdout

    def compare_pictures(self) -> None:
        """What was drawn is what the book shows under that name."""
        for drawn in self.folder.glob("*.svg") if self.folder else ():
            own = SHOWN.get((name_of(self.page), self.where), drawn.name)
            name = own if drawn.name == "estimates.svg" else drawn.name
            shown = ROOT / "docs" / "pictures" / name
            if not shown.exists() or curves(drawn) == curves(shown):
                continue
            assert WRITES, f"{self.page.name} does not draw {name}"
            shutil.copy(drawn, shown)


def study(fragment: str, room: Path) -> None:
    """Keys and values of a study are read before its plant, of which there is none."""
    path = room / "fragment.toml"
    path.write_text(fragment if "plant =" in fragment else f'plant = "none.mo"\n{fragment}', encoding="utf-8")
    with pytest.raises(lynkeus.InputError, match="no plant file at"):
        lynkeus.Study.load(path).check()


def model(fragment: str, _: Path) -> None:
    lynkeus.Model.from_modelica(fragment)


def ode_model(fragment: str, room: Path) -> None:
    (room / "fragment.jl").write_text(fragment, encoding="utf-8")
    lynkeus.Model.load(room / "fragment.jl")


def ini(fragment: str, _: Path) -> None:
    configparser.ConfigParser(interpolation=None).read_string(fragment)


#: what reads a fragment of each language
FRAGMENTS: dict[str, Callable[[str, Path], object]] = {
    "toml": study,
    "modelica": model,
    "julia": ode_model,
    "json": lambda text, _: [json.loads(line) for line in ([text] if "\n  " in text else text.splitlines())],
    "yaml": lambda text, _: yaml.safe_load(text),
    "ini": ini,
    # the site's build sets formulas, and ends where one cannot be set
    "math": lambda text, _: None,
}


def optimisers_and_samplers_end_where_the_fit_does(names: dict[str, Any]) -> None:
    """What `docs/python.md` has in its names."""
    fit, theta = names["fit"], names["ended"].x
    sd = np.array([fit.parameters["k"].sd, fit.noise["y"].sd])
    np.testing.assert_allclose(theta, names["theta"], rtol=1e-5)
    np.testing.assert_allclose(names["sd"], sd, rtol=1e-3)
    np.testing.assert_allclose(names["slopes"] / theta, names["likelihood"].gradient(theta), rtol=1e-6)
    np.testing.assert_allclose(names["sample"].std(axis=0), sd, rtol=0.1)


def curves(svg: Path) -> list[str]:
    return re.findall(r'points="([^"]*)"', svg.read_text(encoding="utf-8"))


def matches(shown: str, printed: str) -> bool:
    """Whether these are the same but for last digits, times and what ``…`` leaves out."""
    parts = [re.escape(part) for part in re.split(r"^…\n", alike(shown), flags=re.MULTILINE)]
    return re.fullmatch("(?:.*\n)*".join(parts), alike(printed)) is not None


def alike(text: str) -> str:
    if "µs/sample" in text:
        # the last column of a comparison
        text = re.sub(r" +[\d.]+$", "", text, flags=re.MULTILINE)
    text = OURS.sub("TIME", NUMBER.sub(lambda m: f"{float(m[0]):.3g}", text))
    return "".join(f"{re.sub(' +', ' ', line).rstrip()}\n" for line in text.splitlines())
