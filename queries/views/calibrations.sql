-- One row a statistic and triple of a calibration.
--
-- column N: Number of its samples.
SELECT *, len(samples) AS N FROM stored_calibrations
