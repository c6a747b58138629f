"""What live estimators tell of their readings; see :mod:`lynkeus.reports`."""

from __future__ import annotations

from typing import Literal, TypedDict


class Innovation(TypedDict):
    """What the last reading of a sensor said."""

    innovation: float
    """the reading less what was expected, in the sensor's unit; NaN where there is none"""
    sd: float
    """the standard deviation of that"""
    expected: float
    """what was expected"""
    reading: Literal["missing", "taken", "rejected", "at a limit"]
    """what became of the reading"""


class SensorHealth(TypedDict):
    """Counts of a sensor's readings."""

    taken: int
    """readings that were taken"""
    missing: int
    """readings that were missing"""
    rejected: int
    """readings that the gate rejected"""
    at_limit: int
    """readings at a limit of the sensor"""
    locked_out: int
    """readings rejected in a row, up to now"""


class Health(TypedDict):
    """Counts of an estimator."""

    sensors: dict[str, SensorHealth]
    """by sensor"""
    inputs_held: int
    """values of known inputs that were missing, where the last one held"""
    confined: int
    """samples at which the estimate was put back to where the plant has values"""
    unsolved: int
    """samples at which a moving horizon did not come to its minimum"""
    too_late: int
    """samples that came later than is waited for, which are not used"""


class Revised(TypedDict):
    """A row that an estimator went over again, because a reading came late."""

    t: float
    """its time"""
    estimate: dict[str, float]
    """what is estimated there now, by name"""
    sd: dict[str, float] | None
    """standard deviations by name, where the observer has them"""
