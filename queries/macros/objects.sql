-- What the queries on the object-level baseline share.

-- How much the objects of two sensors do not match at this intersection over union, 0 where all do or there are none.
-- The score of the surest object without a partner, or, where they have no scores, the share of those without one.
CREATE MACRO unmatched(best, scores, iou) AS
    CASE
        WHEN len(best) = 0 THEN 0.0
        WHEN scores IS NULL THEN len(list_filter(best, lambda x: x < iou)) / len(best)
        ELSE coalesce(list_max(list_filter(scores, lambda x, i: best[i] < iou)), 0.0)
    END;
