"""Training a network matcher: recordings and synthetic streets become samples, samples a network."""

from auditor.learning.sampling import Made, SampleFiles, SampleTask, make_samples
from auditor.learning.sources import Recorded, SampleSource, Street
from auditor.learning.teaching import CURVE, WEIGHTS, Lesson, Point, lesson, teach

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
