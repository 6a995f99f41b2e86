"""Motion estimation for MEMS devices with capacitive sensors.

    import kalmems

    experiment = kalmems.Experiment.load("experiment.toml")
    result = experiment.estimate(kalmems.Recording({"time_s": t, "drive_V": drive, "cap_V": signal}))
    ekf = result["EKF"]
    print(result.summary(), ekf.angle, ekf.angle_sd)

All numbers are in SI.
"""

from . import applications, filters, metrics
from ._batch import Batch
from ._errors import (
    EstimationError,
    ExperimentError,
    Finding,
    KalmemsError,
    RecordingError,
    VerdictError,
    VerdictWarning,
)
from ._experiment import Experiment
from ._kalmems import __version__
from ._recording import Recording
from ._result import (
    Diagnosis,
    Identification,
    Notice,
    Parameter,
    Reference,
    Result,
    Segment,
    SignalInnovations,
    Simulation,
    State,
    Trajectory,
)
from ._stream import Estimate, Event, Stream
from ._study import Part, Study, StudyResult
from .applications import calibrate, image, spectrum

__all__ = [
    "Batch",
    "Diagnosis",
    "Estimate",
    "EstimationError",
    "Event",
    "Experiment",
    "ExperimentError",
    "Finding",
    "Identification",
    "KalmemsError",
    "Notice",
    "Parameter",
    "Part",
    "Recording",
    "RecordingError",
    "Reference",
    "Result",
    "Segment",
    "SignalInnovations",
    "Simulation",
    "State",
    "Stream",
    "Study",
    "StudyResult",
    "Trajectory",
    "VerdictError",
    "VerdictWarning",
    "__version__",
    "applications",
    "calibrate",
    "filters",
    "image",
    "metrics",
    "spectrum",
]
