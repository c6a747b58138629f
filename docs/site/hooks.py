"""What makes a site of the repository: its pages outside of docs/, its links, the notebooks, the references.

Links in Markdown are those that work in the repository and on GitHub. Here each is resolved in the
repository and becomes the page that the file is on the site, or the file at GitHub; one that leads
nowhere is a warning, which ends a strict build.
"""

from __future__ import annotations

import ast
import importlib.util
import json
import logging
import os
import posixpath
import re
import sys
from pathlib import Path
from typing import Any

from mkdocs.structure.files import File, Files

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(Path(__file__).parent))

import formulas  # noqa: E402  (beside this file)
import messages  # noqa: E402
import notebooks  # noqa: E402

LOG = logging.getLogger("mkdocs.hooks.lynkeus")
TOP = ["ARCHITECTURE.md", "BENCHMARKS.md", "CHANGELOG.md", "CONTRIBUTING.md"]
#: made by the notebooks, beside their pages
PICTURES: set[str] = set()
#: languages of the gallery's files
SUFFIX = {".toml": "toml", ".mo": "modelica"}
#: the target of a link or picture, outside of code; a heading's text may have brackets of its own
LINK = re.compile(r"(?<=\]\()(?!\w+:|#)([^)\s]+)(?=\))")
#: what everything else is met through
FIRST = ["Study", "Model", "Estimator", "Log", "Answer", "Table", "Run"]
#: what modules have that are imported by themselves, and what `from lynkeus import *` leaves out
MODULES = ["abs", "ray.campaign", "ray.sweep", "spark.estimate", "spark.follow", "mpc.Estimator", "results.figures"]
MODULES += ["reports", "sections"]
#: stands for the repository's address where mkdocs.yml has none
NOWHERE = "source:"
SOURCE = re.compile(r'<a href="source:[^"]*">(.*?)</a>', re.DOTALL)
ROLE = re.compile(r":(?:attr|class|exc|func|meth|mod):(?=<code>)")
CODE = re.compile(r"(^(?:```|~~~).*?^(?:```|~~~)\s*?$|`[^`\n]+`)", re.MULTILINE | re.DOTALL)


def on_config(config: Any) -> Any:
    """Pages with formulas need KaTeX's style; without KaTeX they show formulas as they are written."""
    try:
        formulas.install()
        config.extra_css += ["formulas/katex.min.css", "formulas/formulas.css"]
    except formulas.Missing as why:
        say = LOG.warning if os.environ.get("CI") else LOG.info
        say("formulas are shown as they are written: %s", why)
    return config


def on_files(files: Files, config: Any) -> Files:
    """Adds the pages that are not in docs/."""
    if config.extra_css:
        for path in (*formulas.files(), formulas.HERE / "formulas.css"):
            name = f"fonts/{path.name}" if path.suffix == ".woff2" else path.name
            files.append(File.generated(config, f"formulas/{name}", abs_src_path=str(path)))
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
    files.append(File.generated(config, "gallery.md", content=gallery()))
    files.append(File.generated(config, "reference/json.md", content=json_reference()))
    files.append(File.generated(config, "reference/messages.md", content=messages.page(ROOT)))
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
    """Formulas are set; roles of docstrings (``:class:`Study```) are words in code here, and links to sources without an
    address words."""
    html = SOURCE.sub(r"\1", html)
    if config.extra_css:
        try:
            html = formulas.rendered(html)
        except ValueError as why:
            LOG.warning("%s: a formula cannot be set: %s", page.file.src_uri, why)
    return ROLE.sub("", html) if page.file.src_uri == "reference/python.md" else html


def pages() -> list[str]:
    """Markdown files of the repository that are pages."""
    found = [*ROOT.glob("docs/*.md"), *ROOT.glob("docs/tutorials/*.md"), *ROOT.glob("docs/how-to/*.md"), *ROOT.glob("examples/README.md"), *ROOT.glob("examples/*/README.md")]
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
    if site.startswith("reference/") or site == "gallery.md":
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
        return f"{config.repo_url or NOWHERE}/{kind}/main/{target}{hash_}{anchor}"
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


def gallery() -> str:
    """Every picture that is drawn from a study, with the study and the command."""
    parts = ["# Gallery", "Every picture is drawn by the command beside it from a study that the repository ships."]
    for study in sorted((ROOT / "examples").glob("*/*.toml")):
        what = study.stem.removeprefix("study").lstrip("-")
        name = f"{study.parent.name}-{what}" if what else study.parent.name
        if not (ROOT / "docs" / "pictures" / f"{name}.svg").exists():
            continue
        log = study.with_name("log.csv").exists()
        command = f"lynkeus {'estimate' if log else 'simulate'} {study.name}{' log.csv' if log else ''} --plot {name}.svg"
        parts += [f"## {name}", f"![{name}](pictures/{name}.svg)", f"```sh\n{command}\n```"]
        for path in (study, *sorted(study.parent.glob("*.mo"))):
            parts.append(f'```{SUFFIX[path.suffix]} title="{path.name}"\n{path.read_text(encoding="utf-8").rstrip()}\n```')
        parts.append(f"[About this plant](examples/{study.parent.name}/README.md)")
    return "\n\n".join(parts) + "\n"


def json_reference() -> str:
    """What every command prints with ``--json``, from the schema."""
    schema = json.loads((ROOT / "docs" / "answers.schema.json").read_text(encoding="utf-8"))
    text = "Every command takes `--json` and prints one object. This page is made from"
    parts = ["# JSON", f"{text} [the schema](../answers.schema.json); [that of studies](../study.schema.json) is `lynkeus schema`."]
    for name, found in sorted(schema["$defs"].items()):
        parts.append(f"## {name}")
        parts += [found["description"]] if "description" in found else []
        if properties := found.get("properties"):
            needed = found.get("required", [])
            rows = [f"| `{key}` | {kind(of)} | {cell(of, key in needed)} |" for key, of in properties.items()]
            parts.append("\n".join(["| entry | type | meaning |", "|---|---|---|", *rows]))
        else:
            parts.append(kind(found))
    return "\n\n".join(parts) + "\n"


def cell(of: Any, is_needed: bool) -> str:
    """The meaning of an entry."""
    text = of.get("description", "") if isinstance(of, dict) else ""
    return " ".join(text.split()).replace("|", "&#124;") + ("" if is_needed else " (may be absent)")


def kind(of: Any) -> str:
    """A type of the schema in words, with links to the others of the page."""
    if not isinstance(of, dict):
        return "anything"
    if "$ref" in of:
        name = of["$ref"].rsplit("/", 1)[-1]
        return f"[{name}](#{name.lower()})"
    for several in ("anyOf", "oneOf", "allOf"):
        if several in of:
            return " or ".join(dict.fromkeys(kind(one) for one in of[several]))
    if "enum" in of or "const" in of:
        return ", ".join(f"`{json.dumps(word)}`" for word in of.get("enum", [of.get("const")]))
    if "items" in of:
        return f"list of {kind(of['items'])}"
    if "additionalProperties" in of and of["additionalProperties"]:
        return f"by name: {kind(of['additionalProperties'])}"
    named = of.get("type", "anything")
    return " or ".join(named) if isinstance(named, list) else str(named)


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
