-- What the queries on the object-level baseline share.

-- Share of the objects that have no partner at this intersection over union; 0 where there are no objects.
CREATE MACRO unmatched(best, iou) AS
    CASE WHEN len(best) = 0 THEN 0.0 ELSE len(list_filter(best, lambda x: x < iou)) / len(best) END;
