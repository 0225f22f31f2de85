"""Health of a gauge as a window shows it, apart from what makes it, which loads scipy."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from analysis.health_grade import HealthGrade
from app.presenters.base import LabelledValue

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class SymptomText:
    code: str
    grade: HealthGrade
    message: str
    remedy: str


@dataclass(frozen=True, eq=False, slots=True)
class GaugeHealthState:
    name: str
    verdict: HealthGrade
    symptoms: tuple[SymptomText, ...]
    """The worst first."""
    figures: tuple[LabelledValue, ...]  # the same lines for each gauge
    frequency_hz: Floats
    density_um: Floats
    """Noise spectrum (µm/√Hz)."""
