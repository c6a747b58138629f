"""The README, tutorials and how-to pages do what they show: their blocks run in order, and what they print is what stands there.

A page says where it starts: ``<!-- starts in an empty folder -->`` or ``<!-- starts in a copy of examples/two-tanks -->``.
A block with ``title="NAME"`` is a file that the reader saves; ``sh`` and ``python`` blocks run, and a ``text`` block
right behind one is its output, where a line ``…`` stands for any number of lines. A block after ``<!-- not run: why -->`` is
left alone. ``LYNKEUS_WRITE_DOCS=1`` writes outputs without ``…`` anew.
"""

from __future__ import annotations

import contextlib
import io
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from conftest import ROOT

PAGES = [ROOT / "README.md", *sorted(ROOT.glob("docs/tutorials/*.md")), *sorted(ROOT.glob("docs/how-to/*.md"))]
BLOCK = re.compile(r"^(<!-- not run: [^\n]+ -->\n)?```(\w*)([^\n]*)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
START = re.compile(r"^<!-- starts in (?:an empty folder|a copy of (\S+)) -->$", re.MULTILINE)
TITLE = re.compile(r'title="([^"]+)"')
NUMBER = re.compile(r"(?<![\w.])[-+]?\d+\.\d+(?:e[-+]?\d+)?")
#: what is of one machine
OURS = re.compile(r"\d+(\.\d+)? (s|ms|µs)\b")


@pytest.fixture
def shell(command: Path, tmp_path: Path) -> Iterator[dict[str, str]]:
    """An environment in which ``lynkeus`` is the command of the same sources."""
    folder = tmp_path / "bin"
    folder.mkdir()
    (folder / "lynkeus").symlink_to(command)
    python = Path(sys.executable).parent
    path = os.pathsep.join([str(folder), str(python), os.environ["PATH"]])
    yield {**os.environ, "PATH": path, "NO_COLOR": "1", "LC_ALL": "C.UTF-8"}


@pytest.mark.skipif(os.name == "nt", reason="the pages are for a POSIX shell")
@pytest.mark.parametrize("page", PAGES, ids=lambda page: f"{page.parent.name}/{page.stem}")
def test_page(page: Path, shell: dict[str, str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    text = page.read_text(encoding="utf-8")
    start = START.search(text)
    assert start, f"{page.name} does not say where it starts"
    folder = tmp_path / "work"
    shutil.copytree(ROOT / start[1], folder) if start[1] else folder.mkdir()
    monkeypatch.chdir(folder)
    names: dict[str, object] = {"__name__": page.stem}
    printed, written, end = None, "", 0
    for block in BLOCK.finditer(text):
        skipped, language, info, body = block.groups()
        is_behind = printed is not None and not text[end : block.start()].strip()
        written += text[end : block.start()]
        end = block.end()
        if language == "text" and is_behind:
            assert printed is not None
            if "LYNKEUS_WRITE_DOCS" in os.environ and "\n…\n" not in f"\n{body}":
                body = printed
            assert matches(body, printed), f"{page.name} shows\n{body}\nand it prints\n{printed}"
            written += f"```text\n{body}```"
            printed = None
            continue
        written += block[0]
        printed = None
        if skipped:
            continue
        if title := TITLE.search(info):
            (folder / title[1]).parent.mkdir(parents=True, exist_ok=True)
            (folder / title[1]).write_text(body, encoding="utf-8")
        elif language == "sh":
            done = subprocess.run(
                ["bash", "-ec", body],
                env=shell,
                stdout=subprocess.PIPE,
                stderr=subprocess.STDOUT,
                text=True,
                check=False,
            )
            assert done.returncode == 0, f"{page.name}:\n{body}\n{done.stdout}"
            printed = done.stdout
        elif language == "python":
            out = io.StringIO()
            with contextlib.redirect_stdout(out):
                exec(compile(body, page.name, "exec"), names)
            printed = out.getvalue()
    pictures = [p for name in re.findall(r"--plot (\S+\.svg)", text) if (p := folder / name).exists()]
    shown = ROOT / "docs" / "pictures" / f"{page.stem}.svg"
    if "LYNKEUS_WRITE_DOCS" in os.environ:
        page.write_text(written + text[end:], encoding="utf-8")
        if shown.exists():
            shutil.copy(pictures[0], shown)
    if shown.exists():
        assert curves(pictures[0]) == curves(shown), f"{shown.name} is not what {page.name} draws"


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
