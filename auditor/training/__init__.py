"""Training a network matcher: recordings and synthetic streets become samples, samples a network."""

from auditor.training.run import CURVE, WEIGHTS, Lesson, Point, lesson, teach
from auditor.training.samples import Made, Recorded, SampleFiles, SampleSource, SampleTask, Street, make_samples

__all__ = [
    "CURVE",
    "WEIGHTS",
    "Lesson",
    "Made",
    "Point",
    "Recorded",
    "SampleFiles",
    "SampleSource",
    "SampleTask",
    "Street",
    "lesson",
    "make_samples",
    "teach",
]
