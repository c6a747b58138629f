"""What several tests share."""

from __future__ import annotations

import os
from pathlib import Path

import pytest
from tank_study import SIMULATE, tank

import lynkeus

ALL = bool(os.environ.get("LYNKEUS_ALL_TESTS"))
"""Whether tests run that are left out for the time that they take: ``cargo xtask test --all`` says so."""

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="session")
def examples() -> Path:
    """The shipped studies."""
    return ROOT / "examples"


@pytest.fixture(scope="session")
def command() -> Path:
    """The ``lynkeus`` command of the same sources."""
    named = os.environ.get("LYNKEUS_COMMAND")
    if not named:
        pytest.skip("LYNKEUS_COMMAND names no command: `cargo xtask package` does")
    return Path(named)


@pytest.fixture(scope="session")
def study() -> lynkeus.Study:
    """The tank with noise, ready to be simulated."""
    return tank(noise={"y": 0.01}, observer={"theta": 1.0}, simulate=SIMULATE)
