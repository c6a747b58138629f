"""Formulas, set by KaTeX while the site is built: pages hold what is shown, and ask for style and fonts of this site alone."""

from __future__ import annotations

import html
import json
import os
import re
import shutil
import subprocess
from pathlib import Path

HERE = Path(__file__).parent
MODULES = HERE / "node_modules"
DIST = MODULES / "katex" / "dist"
#: as `pymdownx.arithmatex` leaves a block
BLOCK = re.compile(r'<div class="arithmatex">\s*\\\[(.*?)\\\]\s*</div>', re.DOTALL)


class Missing(Exception):
    """What sets formulas is not there."""


def install() -> None:
    """Fetches KaTeX, as pinned, where it is not here yet.

    Raises
    ------
    Missing
        There is no npm or no node, or the package cannot be had.
    """
    pinned = (HERE / "package-lock.json").read_text(encoding="utf-8")
    stamp = MODULES / "installed.json"
    if stamp.exists() and stamp.read_text(encoding="utf-8") == pinned:
        return
    npm = shutil.which("npm")
    if npm is None or shutil.which("node") is None:
        raise Missing("there is no npm or no node here")
    done = subprocess.run(
        [npm, "ci", "--no-audit", "--no-fund"], cwd=HERE, capture_output=True, text=True, check=False
    )
    if done.returncode:
        raise Missing(f"npm cannot install it: {done.stderr.strip()}")
    stamp.write_text(pinned, encoding="utf-8")


def files() -> list[Path]:
    """Style and fonts, beside each other as KaTeX has them."""
    return [DIST / "katex.min.css", *sorted(DIST.glob("fonts/*.woff2"))]


def rendered(page: str) -> str:
    """The page with its formulas set.

    Raises
    ------
    ValueError
        A formula cannot be set.
    """
    found = BLOCK.findall(page)
    if not found:
        return page
    asked = [{"tex": html.unescape(tex), "display": True} for tex in found]
    done = subprocess.run(
        ["node", HERE / "formulas.mjs"], input=json.dumps(asked), capture_output=True, text=True, check=False, env=os.environ
    )
    if done.returncode:
        raise ValueError(done.stderr.strip())
    made = iter(json.loads(done.stdout))
    return BLOCK.sub(lambda _: f'<div class="formula">{next(made)}</div>', page)
