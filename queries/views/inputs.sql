-- One row a path that was ever offered to a scan, with what became of it when it was offered last: the ledger of inputs.
SELECT *
FROM stored_inputs
QUALIFY row_number() OVER (PARTITION BY path ORDER BY offered_at DESC, inputs_id DESC) = 1
