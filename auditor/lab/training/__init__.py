"""Training of a network matcher on samples of recordings and of synthetic streets."""

from auditor.lab.training.checkpoints import CURVE, WEIGHTS, CurvePoint, TrainingSet, train_on, training_set
from auditor.lab.training.samples import (
    RecordingSamples,
    SampleFiles,
    SampleSet,
    SampleSource,
    SampleTask,
    StreetSamples,
    make_samples,
)

__all__ = [
    "CURVE",
    "WEIGHTS",
    "CurvePoint",
    "RecordingSamples",
    "SampleFiles",
    "SampleSet",
    "SampleSource",
    "SampleTask",
    "StreetSamples",
    "TrainingSet",
    "make_samples",
    "train_on",
    "training_set",
]
