"""Grades of the health of a gauge, apart from what measures it: a window that shows them loads no scipy."""

from enum import StrEnum


class HealthGrade(StrEnum):
    """Condition of a gauge, from good to bad."""

    GOOD = "good"
    DOUBTFUL = "doubtful"
    BAD = "bad"
