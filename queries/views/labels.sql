-- One row a label, which is ground truth: those that recordings carry, and those given with auditor label.
--
-- column topic: The topic whose data was attacked; NULL where the recording is known to be clean.
-- column sensor: Its sensor in the recording's rig; NULL where no rig has the topic.
-- column attack: The kind of attack; NULL where the recording is known to be clean.
-- column from_ns: Stamp of the first attacked message, included.
-- column to_ns: Stamp of the last attacked message, included.
-- column given: TRUE where it was given with auditor label, FALSE where the recording carries it.
SELECT *, FALSE AS given FROM stored_labels
UNION ALL BY NAME
SELECT * EXCLUDE (given_at), TRUE AS given FROM stored_given_labels
