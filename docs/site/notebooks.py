"""Notebooks as pages: their text, their code, and what running them shows."""

from __future__ import annotations

import base64
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import jupytext

#: what of an output is shown, the first that there is
PICTURE, TABLE, TEXT = "image/png", "text/html", "text/plain"


def rendered(path: Path, run: bool) -> dict[str, str | bytes]:
    """The page of a notebook and its pictures, by their names."""
    notebook = jupytext.read(path)
    if run:
        _execute(notebook, path)
    files: dict[str, str | bytes] = {}
    parts: list[str] = []
    for cell in notebook.cells:
        if cell.cell_type == "markdown":
            parts.append(cell.source)
            continue
        parts.append(f"```python\n{cell.source}\n```")
        parts += [_output(output, path.stem, files) for output in cell.get("outputs", [])]
    files[f"{path.stem}.md"] = "\n\n".join(part for part in parts if part) + "\n"
    return files


def _execute(notebook: Any, path: Path) -> None:
    from nbclient import NotebookClient

    # the kernel takes these from here
    os.environ.setdefault("PYTHONWARNINGS", "default")
    resources = {"metadata": {"path": str(path.parent)}}
    NotebookClient(notebook, timeout=600, kernel_name="python3", resources=resources).execute()


def _output(output: Mapping[str, Any], stem: str, files: dict[str, str | bytes]) -> str:
    if output["output_type"] == "stream":
        return _fenced(output["text"])
    data = output.get("data", {})
    if PICTURE in data:
        name = f"{stem}-{len(files)}.png"
        files[name] = base64.b64decode(data[PICTURE])
        return f"![]({name})"
    if TABLE in data:
        # no empty line: it would end the block for Markdown
        return "\n".join(line for line in data[TABLE].splitlines() if line.strip())
    return _fenced(data.get(TEXT, ""))


def _fenced(text: str) -> str:
    return f"```text\n{text.rstrip()}\n```" if text.strip() else ""
