-- One row a label, which is ground truth.
SELECT * FROM stored_labels
