"""The messages of Lynkeus, read from its sources: what is wrong, and what to do, by the code that ``check --lsp`` gives."""

from __future__ import annotations

import re
from pathlib import Path

TEXT = r'"((?:[^"\\]|\\.)*)"'
#: what makes a message, and the hint that follows it in the same expression
MADE = re.compile(
    r"(Error::(?:input|refused)|Problem::new|\.wrong|#\[error)\((?:[\w.&\s]+,\s*)?\s*(?:&?format!\(\s*)?" + TEXT
    + r"|\.(?:or_)?hint\(\s*(?:&?format!\(\s*)?" + TEXT
)
TESTS = re.compile(r"^#\[cfg\(test\)\]\nmod \w+ \{.*", re.MULTILINE | re.DOTALL)
#: how far behind its message a hint may stand
NEAR = 600


def page(root: Path) -> str:
    """Every crate with messages, in the order of its files."""
    parts = ["# Messages", INTRODUCTION]
    for crate in sorted((root / "crates").iterdir()):
        rows = []
        for path in sorted((crate / "src").rglob("*.rs")):
            if "tests" in path.with_suffix("").parts:
                continue
            for message, hint in messages(path.read_text(encoding="utf-8")):
                rows.append(f"| {cell(message)} | {cell(hint)} | `{code(crate, path)}` |")
        if rows:
            parts.append("\n".join([f"## {crate.name}\n", "| message | what to do | code |", "|---|---|---|", *rows]))
    return "\n\n".join(parts) + "\n"


INTRODUCTION = """What is refused, why, and what to do. The page is made from the sources: a word in braces stands for what was found. Those that are put
together from several texts are left out.
The code is what `lynkeus check STUDY --lsp` gives with a diagnostic: the subject of the message, and the file of the sources that has it.
What a message that users meet often means, at length: [troubleshooting](../troubleshooting.md)."""


def code(crate: Path, path: Path) -> str:
    """As `lynkeus_answer::code` has it."""
    name = crate.name.removeprefix("lynkeus-")
    return f"{name}/{path.relative_to(crate / 'src').as_posix().removesuffix('.rs').removesuffix('/mod')}"


def messages(source: str) -> list[tuple[str, str]]:
    """Each message of a file with its hint."""
    rows: list[tuple[str, str]] = []
    end = 0
    for found in MADE.finditer(TESTS.sub("", source)):
        maker, message, hint = found.groups()
        if message is not None:
            rows.append((f"expected {message}" if maker == ".wrong" else message, ""))
        elif rows and not rows[-1][1] and found.start() - end < NEAR:
            rows[-1] = (rows[-1][0], hint)
        end = found.end()
    return [row for row in dict.fromkeys(rows) if re.search(r"[a-z]{3}", re.sub(r"\{[^}]*\}", "", row[0]))]


def cell(text: str) -> str:
    """A literal of Rust in a table."""
    text = re.sub(r"\\\n\s*", "", text)
    text = text.replace('\\"', '"').replace("\\n", " ").replace("\\\\", "\\").replace("{{", "{").replace("}}", "}")
    text = re.sub(r"\{(\w*)[^}]*\}", lambda m: "{" + (m[1] or "…") + "}", text)
    parts = text.replace("|", "&#124;").split("`")
    # every other part is code
    parts[::2] = [re.sub(r"([\\*_\[])", r"\\\1", part).replace("<", "&lt;") for part in parts[::2]]
    return "`".join(parts)
