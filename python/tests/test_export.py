"""Exported estimators: the command's files."""

from __future__ import annotations

from pathlib import Path

import lynkeus
import pytest
from tank_study import tank


def test_files_are_written_once(tmp_path: Path) -> None:
    study = tank(estimate={"method": "rk4", "step": 0.1})
    made = study.export(tmp_path / "device")
    assert [file.name for file in made.files] == ["tank.h", "tank.c", "replay.c", "CMakeLists.txt"]
    assert b"int tank_push(" in made.files[0].read_bytes()
    with pytest.raises(lynkeus.InputError, match="force=True"):
        study.export(tmp_path / "device")
    again = study.export(tmp_path / "device", precision="f32", step=0.05, force=True)
    assert b"const float *signals" in again.files[0].read_bytes()


def test_a_step_that_was_chosen_is_told(tmp_path: Path) -> None:
    made = tank().export(tmp_path, to="js")
    assert [file.suffix for file in made.files] == [".mjs"]
    assert any("the fastest mode" in note for note in made.notes)


def test_a_crate_has_folders(tmp_path: Path) -> None:
    made = tank().export(tmp_path, to="rust", precision="f32")
    names = [file.relative_to(tmp_path).as_posix() for file in made.files]
    assert names == ["Cargo.toml", "src/lib.rs", "examples/replay.rs"]
    assert b"signals: &[f32; SIGNALS]" in made.files[1].read_bytes()


def test_a_controller_gets_a_function_block(tmp_path: Path) -> None:
    made = tank().export(tmp_path, to="st")
    assert [file.name for file in made.files] == ["tank.st", "example.st"]
    assert b"\nFUNCTION_BLOCK tank\n" in made.files[0].read_bytes()


def test_what_is_not_known_is_refused(tmp_path: Path) -> None:
    for wrong in ({"to": "cobol"}, {"precision": "f16"}, {"to": "fmu", "fmi": "1"}):
        with pytest.raises(ValueError, match="expected"):
            tank().export(tmp_path, **wrong)
    assert not list(tmp_path.iterdir())
