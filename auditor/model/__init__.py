"""The words that all rooms share: frozen types of rigs, frames, measurements, verdicts and calibrations."""
