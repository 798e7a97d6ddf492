-- One row a measured frame and matched camera pair: what separates a fault from an attack.
--
-- column frame: Number of the frame within the recording.
-- column i: The source camera.
-- column k: The reference camera.
SELECT * FROM stored_fault_features
