"""Campaigns on a local cluster of Ray give what each run gives alone."""

from __future__ import annotations

import os
import signal
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import lynkeus
import lynkeus.ray
from lynkeus.results import figures

ray = pytest.importorskip("ray", reason="skipped: ray is not installed")
data = pytest.importorskip("ray.data")

pytestmark = pytest.mark.filterwarnings("ignore")  # Ray's own


@pytest.fixture(scope="module", autouse=True)
def cluster() -> Iterator[None]:
    os.environ["RAY_worker_niceness"] = "0"  # at Ray's 15 a busy machine takes minutes
    ray.init(num_cpus=2, include_dashboard=False, logging_level="error", _node_ip_address="127.0.0.1")
    data.DataContext.get_current().enable_progress_bars = False
    yield
    ray.shutdown()


def ordered(dataset: Any, key: str = "seed") -> list[dict[str, Any]]:
    return sorted(dataset.take_all(), key=lambda row: int(row[key]))


@pytest.mark.parametrize("blocks", [1, 3, 6])
def test_seeds_whatever_the_blocks(study: lynkeus.Study, blocks: int) -> None:
    changes = [{"simulate": {"seed": seed}} for seed in range(1, 7)]
    alone = study.sweep(changes, keep=figures)
    found = ordered(lynkeus.ray.campaign(study, range(1, 7), blocks=blocks))
    assert found == [{"seed": place + 1, "error": None, **row} for place, row in enumerate(alone)]
    assert len({row["rms_inflow"] for row in found}) == 6


def test_columns_and_failures(study: lynkeus.Study) -> None:
    changes: list[dict[str, Any]] = [{"observer": {"theta": 2.0}}, {"observer": {"nix": 1}}]
    found = ordered(
        lynkeus.ray.sweep(study, changes, keep=lambda run: {"inflow_hat": run["inflow_hat"]}, blocks=1),
        "place",
    )
    run = study.replace(**changes[0]).simulate()
    np.testing.assert_array_equal(found[0]["inflow_hat"], run["inflow_hat"])
    assert found[0]["error"] is None and "nix" in found[1]["error"]
    log = run.log
    # by its value: the workers do not know this module
    kept = lynkeus.ray.sweep(study, changes[:1], log, keep=lambda run: {"last": float(run["inflow_hat"][-1])})
    replayed = ordered(kept, "place")
    assert replayed[0]["last"] == study.replace(**changes[0]).estimate(log)["inflow_hat"][-1]


def test_a_block_in_which_every_run_failed_has_the_columns(study: lynkeus.Study) -> None:
    changes: list[dict[str, Any]] = [{"observer": {"theta": 2.0}}, {"observer": {"nix": 1}}, {"nix": 1}]

    def kept(run: lynkeus.Run) -> dict[str, Any]:
        return {"inflow_hat": run["inflow_hat"], "rows": len(run), "refusal": None}

    for keep in (figures, kept):
        dataset = lynkeus.ray.sweep(study, changes, keep=keep, blocks=3)
        found = ordered(dataset, "place")
        names = ["place", "error", *keep(study.simulate())]
        assert [list(row) for row in found] == [names] * 3
        assert all(row[name] is None for row in found[1:] for name in names[2:]) and found[1]["error"]
        frame = dataset.to_pandas()
        assert list(frame.columns) == names and frame["error"].notna().sum() == 2
    # of a study that fails itself nothing is known
    rows = ordered(lynkeus.ray.sweep(study.replace(observer={"theta": -1.0}), changes[1:], blocks=1), "place")
    assert [list(row) for row in rows] == [["place", "error"]] * 2


def test_a_log_with_texts_and_dates(study: lynkeus.Study) -> None:
    times = np.datetime64("2026-11-22T01:02:03") + np.arange(41) * np.timedelta64(500, "ms")
    log = {"t": times, "y": 4.0 + 0.1 * np.sin(np.arange(41.0)), "note": ["a"] * 41}
    change = {"observer": {"theta": 2.0}}
    rows = ordered(lynkeus.ray.sweep(study, [change], log, keep=lambda run: {"notes": " ".join(run.notes)}), "place")
    assert rows[0]["error"] is None
    assert rows[0]["notes"] == " ".join(study.replace(**change).estimate(log).notes)
    assert "since 2026-11-22T01:02:03" in rows[0]["notes"]


def last(run: lynkeus.Run) -> dict[str, float]:
    return {"last": float(run["inflow_hat"][-1])}


def test_a_killed_worker_loses_nothing(study: lynkeus.Study, tmp_path: Path) -> None:
    marker = tmp_path / "killed"

    def killed_once(run: lynkeus.Run) -> dict[str, Any]:
        if not marker.exists():
            marker.touch()
            os.kill(os.getpid(), signal.SIGKILL)
        return {"last": float(run["inflow_hat"][-1])}

    found = ordered(lynkeus.ray.campaign(study, range(8), keep=killed_once, blocks=4))
    assert marker.exists()
    changes = [{"simulate": {"seed": seed}} for seed in range(8)]
    assert [row["last"] for row in found] == [row["last"] for row in study.sweep(changes, keep=last)]


def test_what_is_asked_for_wrongly(study: lynkeus.Study) -> None:
    with pytest.raises(lynkeus.InputError, match="seeds: expected a whole number of 64 bits, found 1.5"):
        lynkeus.ray.campaign(study, [1.5])  # type: ignore[list-item]
    with pytest.raises(lynkeus.InputError, match="nothing to run"):
        lynkeus.ray.campaign(study, [])
    with pytest.raises(lynkeus.InputError, match="blocks: expected at least 1, found 0"):
        lynkeus.ray.campaign(study, range(3), blocks=0)
