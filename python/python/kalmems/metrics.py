"""The types of `metrics.json`, which `metrics` of a result, a segment and a trajectory have. They are dictionaries.

A key that need not be there is `NotRequired`; one that is always there and may have no value is `None` then. New keys may come, as long as
`schema_version` stays.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, TypedDict

if TYPE_CHECKING:
    from typing_extensions import NotRequired

__all__ = [
    "AngleErrors",
    "Answer",
    "AnswerChange",
    "AxisMetrics",
    "Claim",
    "Consistency",
    "Course",
    "DeviceUncertainty",
    "DriveMetrics",
    "ErrorDecomposition",
    "EstimatorMetrics",
    "FilterSelection",
    "FindingText",
    "FoundNoise",
    "InputFault",
    "Lock",
    "LockEvent",
    "Metrics",
    "MotionErrors",
    "OpenGate",
    "Oscillation",
    "Outlier",
    "ParameterAnswer",
    "ParameterCorrelation",
    "ParameterFault",
    "PartErrors",
    "RecordingMetrics",
    "ReferenceLag",
    "Rejections",
    "SampleCounts",
    "ScaleNote",
    "SegmentMetrics",
    "SignalConsistency",
    "SkippedStretch",
    "StepErrors",
    "StretchPlace",
    "StretchSummary",
    "TestPlace",
    "TestResult",
    "TimeOrigin",
    "UncertaintyBudget",
    "ValueErrors",
]


class ErrorDecomposition(TypedDict):
    """How far an error is an offset, a scale and a delay."""

    bias: float
    scale: float
    early_s: float
    share: float


class Claim(TypedDict):
    """Errors over their claimed standard deviations."""

    mean_square: float
    independent: float
    p_value: float
    explained: NotRequired[ErrorDecomposition]


class AngleErrors(TypedDict):
    """Errors of an angle, sample by sample."""

    rmse_deg: float
    rmse_percent_of_peak_to_peak: float
    largest_deg: float
    samples: int
    within_three_sigma: float | None
    claim: NotRequired[Claim]


class PartErrors(TypedDict):
    """Errors of an angle in a part of the recording."""

    from_s: float
    to_s: float
    rmse_deg: float
    samples: int


class ReferenceLag(TypedDict):
    """A delay of the reference that explains most of the error."""

    lag_s: float
    rmse_deg: float


class MotionErrors(TypedDict):
    """Errors of a trajectory against the reference, after the settling time."""

    of: NotRequired[str]
    angle: AngleErrors
    peak_phase_rmse_deg: float | None
    phase_shift_reference_deg: float | None
    phase_shift_estimate_deg: float | None
    peaks: int
    peaks_without_partner: int
    cycle_phase_rmse_deg: float | None
    amplitude_rmse_deg: float | None
    amplitude_reference_deg: float | None
    sign_disagrees: bool
    parts: NotRequired[list[PartErrors]]
    reference_lag: NotRequired[ReferenceLag]
    other_angles: NotRequired[list[MotionErrors]]


class ValueErrors(TypedDict):
    """Errors of a state that is no angle, in its unit."""

    unit: str
    rmse: float
    bias: float
    largest: float
    snr_db: float | None
    scale_factor: float | None
    offset: float | None
    samples: int
    within_three_sigma: float | None
    claim: NotRequired[Claim]


class Consistency(TypedDict):
    """The mean NIS with the interval of a consistent filter."""

    mean_nis: float
    lower: float
    upper: float
    updates: int
    log_likelihood: float


class SignalConsistency(TypedDict):
    """The mean NIS of one of several signals."""

    signal: str
    mean_nis: float
    lower: float
    upper: float
    updates: int


class TestPlace(TypedDict):
    """The place of a finding of a test; it has one key, each with its own numbers."""

    time: NotRequired[dict[str, float]]
    span: NotRequired[dict[str, float]]
    frequency: NotRequired[dict[str, float]]
    band: NotRequired[dict[str, float]]
    harmonic: NotRequired[dict[str, float]]
    phase: NotRequired[dict[str, float]]
    lag: NotRequired[dict[str, int]]
    number: NotRequired[dict[str, str]]
    state: NotRequired[dict[str, str]]


class TestResult(TypedDict):
    """A test of the innovations."""

    p_value: float
    size: float
    place: NotRequired[TestPlace]
    signal: NotRequired[str]


class Outlier(TypedDict):
    """A sample that the gate rejected; `size` in standard deviations."""

    time_s: float
    signal: NotRequired[str]
    size: float


class OpenGate(TypedDict):
    """A span in which the gate was open."""

    from_s: float
    to_s: NotRequired[float]


class Rejections(TypedDict):
    """The samples that the gate rejected, after the settling time."""

    count: int
    share: float
    largest: float
    first: list[Outlier]
    p_value: float
    p_of_cycle: NotRequired[float]
    open: NotRequired[list[OpenGate]]


class ParameterFault(TypedDict):
    """What speaks against a parameter that is a state."""

    kind: str
    deviations: NotRequired[float]
    moved: NotRequired[float]
    sd: NotRequired[float]


class ParameterAnswer(TypedDict):
    """A parameter that is a state, in its unit."""

    unit: str
    start_sd: float
    end: float
    end_sd: float
    fault: NotRequired[ParameterFault]


class ParameterCorrelation(TypedDict):
    """The correlation of two parameters that are states."""

    names: list[str]
    correlation: float


class DeviceUncertainty(TypedDict):
    """The part of an uncertain parameter of the device in a claim."""

    name: str
    sd: float
    told: NotRequired[list[float]]


class UncertaintyBudget(TypedDict):
    """The parts of a claimed standard deviation."""

    unit: str
    sd: float
    noise: float
    device: list[DeviceUncertainty]


class Oscillation(TypedDict):
    """A quantity that oscillates."""

    mean: float
    amplitude: float
    frequency_hz: float
    after_drive_deg: NotRequired[float]


class Course(TypedDict):
    """A quantity that does not oscillate."""

    mean: float
    lowest: float
    highest: float


class Answer(TypedDict):
    """A quantity that the device is for, as `oscillation` or `course`."""

    quantity: str
    unit: str
    oscillation: NotRequired[Oscillation]
    course: NotRequired[Course]
    known_to: NotRequired[float]
    sign_is_arbitrary: NotRequired[bool]


class StepErrors(TypedDict):
    """The errors of the integration, over the claimed standard deviations."""

    steps_per_sample: NotRequired[int]
    error: float
    at_the_end: float


class LockEvent(TypedDict):
    """A loss of the motion, its return, and what else happened to a filter."""

    kind: str
    of: NotRequired[str]
    time_s: float
    detected_s: NotRequired[float]
    unexplained: NotRequired[float]
    settled_s: NotRequired[float]
    restarted_s: NotRequired[float]
    why: NotRequired[str]


class Lock(TypedDict):
    """Whether a filter followed the motion."""

    events: list[LockEvent]


class SampleCounts(TypedDict):
    """How many samples were used, and how many were not; a key that may be missing is 0 then."""

    samples: int
    updates: int
    without_signal: int
    rejected: NotRequired[int]
    bridged: int
    drive_from_sine: int
    drive_bends: NotRequired[int]
    unresolved_kinks: NotRequired[int]
    for_start: NotRequired[int]
    restarted: NotRequired[int]
    lost: NotRequired[int]
    crossings: NotRequired[int]
    crossings_refused: NotRequired[int]


class EstimatorMetrics(TypedDict):
    """Those of a filter; see `Trajectory.metrics`."""

    key: str
    name: str
    verdict: str
    grade: str | None
    tests: NotRequired[dict[str, TestResult]]
    rejections: NotRequired[Rejections]
    parameters: NotRequired[dict[str, ParameterAnswer]]
    parameter_correlations: NotRequired[list[ParameterCorrelation]]
    uncertainty_budget: NotRequired[dict[str, UncertaintyBudget]]
    answer: NotRequired[list[Answer]]
    errors: MotionErrors | None
    values: NotRequired[dict[str, ValueErrors]]
    consistency: Consistency | None
    by_signal: NotRequired[list[SignalConsistency]]
    step_errors: NotRequired[StepErrors]
    lock: Lock
    crossings_log_likelihood: NotRequired[float]
    counts: SampleCounts
    mirrored: bool
    failure: str | None


class DriveMetrics(TypedDict):
    """The sine of a drive."""

    offset_v: float
    amplitude_v: float
    frequency_hz: float


class AxisMetrics(TypedDict):
    """One of several axes."""

    angle: str
    motion_hz: float
    drive: DriveMetrics | None


class FilterSelection(TypedDict):
    """The filter whose predictions are the likeliest."""

    key: str
    name: str
    log_likelihood: float
    ahead: NotRequired[float]


class StretchPlace(TypedDict):
    """The place of a stretch in a record that was cut."""

    number: int
    clock_run: int
    after_s: float | None


class SegmentMetrics(TypedDict):
    """Those of a segment; see `Segment.metrics`."""

    label: str
    stretch: NotRequired[StretchPlace]
    duration_s: float
    skip_s: float
    motion_hz: float | None
    drive: DriveMetrics | None
    other_axes: NotRequired[list[AxisMetrics]]
    arbitrary_signs: NotRequired[list[str]]
    arbitrary_half_turns: NotRequired[list[str]]
    arbitrary_turns: NotRequired[list[list[str]]]
    remarks: NotRequired[list[str]]
    likeliest: NotRequired[FilterSelection]
    estimators: list[EstimatorMetrics]


class FindingText(TypedDict):
    """What was found in a recording."""

    message: str
    kind: str
    column: str | None
    segment: str | None
    first_row: int
    count: int
    detail: str


class TimeOrigin(TypedDict):
    """The moment from which the times of a recording count."""

    seconds: str
    utc: NotRequired[str]


class SkippedStretch(TypedDict):
    """A stretch that could not be estimated."""

    label: NotRequired[str]
    stretch: int
    start_s: float
    samples: int
    why: str


class StretchSummary(TypedDict):
    """The stretches of records that were cut."""

    restarts: int
    left_out: int
    first_left_out: list[SkippedStretch]


class RecordingMetrics(TypedDict):
    """Those of a recording."""

    name: str
    file: str
    origin: NotRequired[TimeOrigin]
    diagnosis: list[FindingText]
    reference: str | None
    reference_diagnosis: list[FindingText]
    stretches: NotRequired[StretchSummary]
    segments: list[SegmentMetrics]


class AnswerChange(TypedDict):
    """The change of an answer that no test of the innovations would see."""

    rms: float
    offset: float
    scale: float
    early_s: float
    share: float
    of_rms: float
    claimed: float


# `with` is a word of Python.
ScaleNote = TypedDict(
    "ScaleNote",
    {
        "parameter": str,
        "with": "NotRequired[list[tuple[str, float]]]",
        "hidden": float,
        "by": float,
        "change": AnswerChange,
        "answer": str,
        "unit": str,
    },
)


class InputFault(TypedDict):
    """A fault of the channels that explains why a filter loses the signal."""

    filter: str
    found: str
    gain: NotRequired[float]
    mean_nis: list[float]


class FoundNoise(TypedDict):
    """A noise that the experiment left to its recording."""

    key: str
    written: str
    interval: list[float]
    of_neighbours: NotRequired[float]
    filter: str
    rows: int
    meaning: NotRequired[str]


class Metrics(TypedDict):
    """All figures of an experiment; see `Result.metrics`."""

    schema_version: int
    experiment: str
    rig: str
    answer: list[str]
    held_as_exact: list[str]
    scale_notes: NotRequired[list[ScaleNote]]
    unseen: NotRequired[list[str]]
    input_fault: NotRequired[InputFault]
    noise_from_recording: NotRequired[list[FoundNoise]]
    recordings: list[RecordingMetrics]
