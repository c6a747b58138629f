"""What makes a site of the repository: its pages outside of docs/, its links, the notebooks, the references.

Links in Markdown are those that work in the repository and on GitHub. Here each is resolved in the
repository and becomes the page that the file is on the site, or the file at GitHub; one that leads
nowhere is a warning, which ends a strict build.
"""

from __future__ import annotations

import ast
import importlib.util
import logging
import posixpath
import re
import sys
from pathlib import Path
from typing import Any

from mkdocs.structure.files import File, Files

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(Path(__file__).parent))

import notebooks  # noqa: E402  (beside this file)

LOG = logging.getLogger("mkdocs.hooks.lynkeus")
TOP = ["ARCHITECTURE.md", "BENCHMARKS.md", "CHANGELOG.md", "CONTRIBUTING.md"]
#: made by the notebooks, beside their pages
PICTURES: set[str] = set()
#: the target of a link or picture, outside of code; a heading's text may have brackets of its own
LINK = re.compile(r"(?<=\]\()(?!\w+:|#)([^)\s]+)(?=\))")
#: what everything else is met through
FIRST = ["Study", "Model", "Estimator", "Log", "Answer", "Table", "Run"]
#: what modules have that are imported by themselves, and what `from lynkeus import *` leaves out
MODULES = ["abs", "ray.campaign", "ray.sweep", "spark.estimate", "spark.follow", "mpc.Estimator", "results.figures"]
MODULES += ["reports", "sections"]
ROLE = re.compile(r":(?:attr|class|exc|func|meth|mod):(?=<code>)")
CODE = re.compile(r"(^(?:```|~~~).*?^(?:```|~~~)\s*?$|`[^`\n]+`)", re.MULTILINE | re.DOTALL)


def on_files(files: Files, config: Any) -> Files:
    """Adds the pages that are not in docs/."""
    for source in pages():
        if not source.startswith("docs/"):
            text = (ROOT / source).read_text(encoding="utf-8")
            files.append(File.generated(config, page_of(source), content=text))
    run = importlib.util.find_spec("lynkeus") is not None
    if not run:
        LOG.info("the notebooks are shown without results: the package lynkeus is not installed")
    for path in sorted((ROOT / "notebooks").glob("*.py")):
        for name, content in notebooks.rendered(path, run).items():
            files.append(File.generated(config, f"notebooks/{name}", content=content))
            PICTURES.add(name)
    files.append(File.generated(config, "reference/python.md", content=python_reference()))
    files.append(File.generated(config, "reference/rust.md", content=rust_reference(files, config)))
    return files


def on_page_markdown(markdown: str, page: Any, config: Any, files: Files) -> str:
    """Maps the links of a page."""
    site = page.file.src_uri
    source = source_of(site)
    if source is None:
        return markdown
    parts = CODE.split(markdown)
    # every other part is code
    parts[::2] = [LINK.sub(lambda m: mapped(m[1], source, site, config), part) for part in parts[::2]]
    return "".join(parts)


def on_page_content(html: str, page: Any, config: Any, files: Files) -> str:
    """Roles of docstrings (``:class:`Study```) are words in code here."""
    return ROLE.sub("", html) if page.file.src_uri == "reference/python.md" else html


def pages() -> list[str]:
    """Markdown files of the repository that are pages."""
    found = [*ROOT.glob("docs/*.md"), *ROOT.glob("examples/README.md"), *ROOT.glob("examples/*/README.md")]
    return ["README.md", *TOP, *(path.relative_to(ROOT).as_posix() for path in found)]


def page_of(source: str) -> str:
    """The page of a file of the repository."""
    if source == "README.md":
        return "index.md"
    if source.startswith("notebooks/"):
        return source.removesuffix(".py") + ".md"
    return source.removeprefix("docs/")


def source_of(site: str) -> str | None:
    """The file of the repository that a page is; ``None`` where the page is made here."""
    if site == "index.md":
        return "README.md"
    if site.startswith("notebooks/"):
        return site.removesuffix(".md") + ".py"
    if site.startswith("reference/"):
        return None
    return site if site in TOP or site.startswith("examples/") else f"docs/{site}"


def mapped(link: str, source: str, site: str, config: Any) -> str:
    """A link of the repository as one of the site."""
    if link in PICTURES:
        return link
    path, hash_, anchor = link.partition("#")
    target = posixpath.normpath(posixpath.join(posixpath.dirname(source), path))
    found = ROOT / target
    if target.startswith("..") or not found.exists():
        LOG.warning("%s: the link %s leads nowhere", source, link)
        return link
    if found.is_dir() and f"{target}/README.md" in pages():
        target += "/README.md"
    is_here = target in pages() or target.startswith("docs/") or target.startswith("notebooks/")
    if not is_here or found.is_dir() and not target.endswith(".md"):
        kind = "tree" if found.is_dir() else "blob"
        return f"{config.repo_url}/{kind}/main/{target}{hash_}{anchor}"
    return posixpath.relpath(page_of(target), posixpath.dirname(site) or ".") + hash_ + anchor


def python_reference() -> str:
    """Every public name of the package, by its sources alone."""
    tree = ast.parse((ROOT / "python" / "lynkeus" / "__init__.py").read_text(encoding="utf-8"))
    names = next(
        ast.literal_eval(node.value)
        for node in tree.body
        if isinstance(node, ast.Assign) and ast.unparse(node.targets[0]) == "__all__"
    )
    ordered = sorted(names, key=lambda name: (FIRST.index(name) if name in FIRST else len(FIRST), name))
    blocks = "\n\n".join(f"::: lynkeus.{name}" for name in [*ordered, *MODULES])
    return f"# Python reference\n\n[Lynkeus in Python](../python.md) shows how they go together.\n\n{blocks}\n"


def rust_reference(files: Files, config: Any) -> str:
    """The crates, with what ``cargo doc`` made of them where it has run."""
    made = ROOT / "target" / "doc"
    lines = ["# Rust reference", "", "`cargo doc --open -p lynkeus` opens the library's front page.", ""]
    for crate in sorted(path.parent.name for path in (ROOT / "crates").glob("*/Cargo.toml")):
        name = crate.replace("-", "_")
        is_made = (made / name / "index.html").exists()
        lines.append(f"- [`{crate}`](../rust/{name}/index.html)" if is_made else f"- `{crate}`")
    if len([line for line in lines if "](" in line]):
        for path in made.rglob("*"):
            if path.is_file() and not path.name.startswith("."):
                rust = f"rust/{path.relative_to(made).as_posix()}"
                files.append(File.generated(config, rust, abs_src_path=str(path)))
    return "\n".join(lines) + "\n"
