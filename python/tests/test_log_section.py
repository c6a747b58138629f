"""``[log]``: columns that are expressions, and files that are written in a way of their own."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from tank_study import tank

import lynkeus

T = np.arange(30) * 0.5
LEVEL = 4 + 0.1 * np.sin(T)
STUDY = tank(noise={"y": 0.1})
IN_INCHES = STUDY.replace(log={"time": "ms/1000", "columns": {"y": "'level in'*0.0254", "inflow": "a + b"}})
COLUMNS = {"ms": 1000 * T, "level in": LEVEL / 0.0254, "a": np.full(30, 0.4), "b": np.full(30, 0.6)}
EXPECTED = STUDY.estimate({"t": T, "y": LEVEL, "inflow": np.ones(30)})


def test_columns_are_expressions_of_headers() -> None:
    found = IN_INCHES.estimate(COLUMNS)
    np.testing.assert_allclose(found["level_hat"], EXPECTED["level_hat"], rtol=1e-12)
    pandas = pytest.importorskip("pandas")
    frame = IN_INCHES.estimate(pandas.DataFrame(COLUMNS))
    assert frame["level_hat"].tolist() == found["level_hat"].tolist()


def test_a_column_that_is_not_there_is_told() -> None:
    with pytest.raises(lynkeus.InputError, match="ms"):
        IN_INCHES.estimate({name: column for name, column in COLUMNS.items() if name != "ms"})
    with pytest.raises(lynkeus.InputError, match="level in"):
        IN_INCHES.estimate({name: column for name, column in COLUMNS.items() if name != "level in"})


def test_a_file_is_read_as_the_study_says(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    rows = [f"{t!r}|{y!r}|1".replace(".", ",") for t, y in zip(T.tolist(), LEVEL.tolist(), strict=True)]
    path.write_text("\n".join(["logger 7", "since Monday", "t|y|inflow", *rows]) + "\n")
    study = STUDY.replace(log={"decimal": ",", "delimiter": "|", "skip": 2})
    assert study.estimate(path)["level_hat"].tolist() == EXPECTED["level_hat"].tolist()
