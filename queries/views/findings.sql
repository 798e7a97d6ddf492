-- One row a frame whose verdict is a finding: attacked, unidentified or suspect. Incidents are runs of these.
--
-- column name: The recording's name; text from outside, to be escaped wherever it is shown.
-- column vehicle: The recording's vehicle.
SELECT * FROM verdicts WHERE kind IN ('attacked', 'unidentified', 'suspect')
