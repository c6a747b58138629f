"""Exported estimators as files."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from ._arguments import flag, optional, path, real, word
from .errors import InputError

#: what :meth:`Study.export` takes
EXPORT = {
    "folder": path,
    "to": word,
    "precision": word,
    "step": optional(real()),
    "tunable": flag,
    "fmi": word,
    "system": optional(word),
    "force": flag,
}


@dataclass(frozen=True)
class Export:
    """What was written."""

    files: tuple[Path, ...]
    """the files, in the folder that was given"""
    notes: tuple[str, ...]
    """what you should know, for example which step was chosen"""


def write(
    folder: Path, files: Sequence[tuple[str, bytes]], notes: Sequence[str], *, force: bool
) -> Export:
    """Everything is there before the first file is written."""
    if folder.exists() and not folder.is_dir():
        raise InputError("expected a folder, or a name for one, found a file", place=str(folder))
    if not force and folder.exists() and any(folder.iterdir()):
        raise InputError(
            "expected an empty folder or none, found one with files: name another, or replace what has "
            "the same names with force=True",
            place=str(folder),
        )
    try:
        for name, content in files:
            file = folder / name
            file.parent.mkdir(parents=True, exist_ok=True)
            file.write_bytes(content)
    except OSError as error:
        raise InputError(f"cannot be written: {error}", place=str(folder)) from error
    return Export(tuple(folder / name for name, _ in files), tuple(notes))
