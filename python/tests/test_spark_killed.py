"""What Spark loses on the way it computes again: a worker of Python, and a whole executor, are killed in the
middle of a batch, and the results are those of each asset alone, to the bit."""

from __future__ import annotations

import os
import signal
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Literal

import pytest
from spark_fleet import Logs, followed, logged, rows, same_as_estimators, same_as_runs, session, write_batches

import lynkeus
import lynkeus.spark
from lynkeus._assets import Follower, Replay

pytestmark = [
    pytest.mark.filterwarnings("ignore"),
    pytest.mark.skipif(
        not os.path.exists("/proc/self/stat"), reason="skipped: whose child a worker is, is read from /proc"
    ),
]

Victim = Literal["worker", "executor"]
VICTIMS: tuple[Victim, ...] = ("worker", "executor")


@pytest.fixture(scope="module")
def spark() -> Iterator[Any]:
    """Two executors of one core each, in processes of their own."""
    made = session("local-cluster[2,1,1024]")
    yield made
    made.stop()


@pytest.fixture(scope="module")
def logs(study: lynkeus.Study) -> Logs:
    return logged(study, 6)


class Once:
    """Kills the process that it is called in, or the executor that this belongs to; only the first time."""

    def __init__(self, marker: Path, victim: Victim) -> None:
        self.marker = str(marker)
        self.victim = victim

    def __call__(self) -> None:
        if os.path.exists(self.marker):
            return
        executor = self._parent(os.getppid())  # a worker is a child of Spark's daemon, and that one of Java
        with open(self.marker, "w") as file:
            file.write(self._name(executor))
        os.kill(os.getpid() if self.victim == "worker" else executor, signal.SIGKILL)

    @staticmethod
    def _parent(process: int) -> int:
        with open(f"/proc/{process}/stat") as file:
            return int(file.read().rpartition(")")[2].split()[1])

    @staticmethod
    def _name(process: int) -> str:
        with open(f"/proc/{process}/comm") as file:
            return file.read().strip()


@pytest.mark.parametrize("victim", VICTIMS)
@pytest.mark.parametrize("is_partitioned", [False, True])
def test_at_rest(
    spark: Any,
    study: lynkeus.Study,
    logs: Logs,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    victim: Victim,
    is_partitioned: bool,
) -> None:
    kill = Once(tmp_path / "killed", victim)

    class Killed(Replay):
        """It is killed when some of its assets are done."""

        done = 0

        def asset(self, table: Any) -> Any:
            self.done += 1
            if self.done == 2:
                kill()
            return super().asset(table)

    monkeypatch.setattr(lynkeus.spark, "Replay", Killed)
    frame = spark.createDataFrame(rows(logs)).repartition(2, "asset")
    found = lynkeus.spark.estimate(study, frame, by="asset", is_partitioned=is_partitioned).toPandas()
    assert Path(kill.marker).read_text() == "java"
    same_as_runs(found, study.estimate_each(logs))


@pytest.mark.parametrize("victim", VICTIMS)
def test_in_motion(
    spark: Any,
    study: lynkeus.Study,
    logs: Logs,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    victim: Victim,
) -> None:
    kill = Once(tmp_path / "killed", victim)

    class Killed(Follower):
        """It is killed in the second batch, when an asset of it is done and the next has rows behind it."""

        done = 0

        def handleInputRows(self, key: Any, given: Iterator[Any], timerValues: Any) -> Iterator[Any]:
            is_second = self.state.exists()
            yield from super().handleInputRows(key, given, timerValues)
            self.done += is_second
            if self.done == 2:
                kill()

    monkeypatch.setattr(lynkeus.spark, "Follower", Killed)
    write_batches(logs, tmp_path / "in", 11)
    found = followed(spark, study, tmp_path / "in", tmp_path / "checkpoint")
    assert Path(kill.marker).read_text() == "java"
    assert len(found) == 22 * len(logs) and found["error"].isna().all()
    same_as_estimators(found, study, logs, 22)
