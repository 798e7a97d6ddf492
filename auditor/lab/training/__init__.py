"""Training of a network matcher on samples of recordings and of synthetic streets."""

from auditor.lab.training.checkpoints import CURVE, WEIGHTS, Point, TrainingSet, train_on, training_set
from auditor.lab.training.samples import Made, Recorded, SampleFiles, SampleSource, SampleTask, Street, make_samples

__all__ = [
    "CURVE",
    "WEIGHTS",
    "Made",
    "Point",
    "Recorded",
    "SampleFiles",
    "SampleSource",
    "SampleTask",
    "Street",
    "TrainingSet",
    "make_samples",
    "train_on",
    "training_set",
]
