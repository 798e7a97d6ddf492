-- Arithmetic that views and queries share.

-- E: inconsistent over valid pixels; NULL where too few are valid for it to be measured.
CREATE MACRO disparity_error(inconsistent_px, valid_px) AS
    CASE WHEN valid_px >= min_valid_px() THEN inconsistent_px / valid_px END;

-- r N in exact arithmetic; a DECIMAL of 18 digits would overflow.
CREATE MACRO outliers(r, N) AS CAST(r AS DECIMAL(38, 17)) * N;

-- theta_r (Eq. 3): of N samples in ascending order that of rank N - floor(r N); -1 at r = 1, NULL without samples.
CREATE MACRO threshold(samples, r) AS
    CASE
        WHEN len(samples) = 0 THEN NULL
        WHEN floor(outliers(r, len(samples))) = len(samples) THEN -1.0
        ELSE samples[len(samples) - CAST(floor(outliers(r, len(samples))) AS BIGINT)]
    END;

-- FALSE where 0 < r < 1/N: N samples cannot tell such a rate from r = 0.
CREATE MACRO resolvable_with(N, r) AS r = 0 OR outliers(r, N) >= 1;

-- One end (side = -1 or 1) of Wilson's 95 % interval of k out of n; NULL where n = 0, or where either is. The low end of
-- none and the high end of all are 0 and 1 exactly, which rounding misses.
CREATE MACRO wilson(k, n, side) AS
    CASE
        WHEN n > 0 AND k = CASE WHEN side < 0 THEN 0 ELSE n END THEN k / n
        WHEN n > 0 AND k IS NOT NULL THEN (
            k / n + 1.959963984540054 ** 2 / (2 * n)
            + side * 1.959963984540054 * sqrt(k / n * (1 - k / n) / n + (1.959963984540054 / (2 * n)) ** 2)
        ) / (1 + 1.959963984540054 ** 2 / n)
    END;

-- The chance of no more than k events where `mean` are expected.
CREATE MACRO poisson_cdf(k, mean) AS
    list_sum(list_transform(range(k + 1), lambda i: exp(i * ln(mean) - mean - lgamma(i + 1))));

-- The upper 95 % bound of a Poisson mean of which k events were seen, by halving.
CREATE MACRO poisson_at_most(k) AS
    list_reduce(
        list_prepend([0.0::DOUBLE, 10.0::DOUBLE * k + 10], list_transform(range(60), lambda s: [0.0::DOUBLE, 0.0::DOUBLE])),
        lambda x, s: CASE
            WHEN poisson_cdf(k, (x[1] + x[2]) / 2) > 0.05 THEN [(x[1] + x[2]) / 2, x[2]]
            ELSE [x[1], (x[1] + x[2]) / 2]
        END
    )[2];

-- True where two lists of lengths agree element by element within a share, or a tolerance.
CREATE MACRO lengths_agree(a, b, tolerance) AS
    len(a) = len(b)
    AND len(list_filter(
        list_zip(a, b),
        lambda x: abs(x[1] - x[2]) > greatest(tolerance, kind_tolerance_share() * greatest(abs(x[1]), abs(x[2])))
    )) = 0;

-- True where two rig kinds are one: equal sensors and image sizes, focal lengths and baselines that agree.
CREATE MACRO kinds_match(a, b) AS
    a['lidar'] = b['lidar']
    AND a['widths_px'] = b['widths_px']
    AND a['heights_px'] = b['heights_px']
    AND lengths_agree(a['focals_px'], b['focals_px'], 0)
    AND lengths_agree(a['baselines_m'], b['baselines_m'], kind_tolerance_m());

-- The recording's own names of sensors, as 'S_1 name'; `sensors` are a rig's.
CREATE MACRO names_of(numbers, sensors) AS
    list_transform(
        list_filter(sensors, lambda s: list_contains(numbers, s['sensor'])),
        lambda s: 'S_' || s['sensor'] || ' ' || s['name']
    );

-- The bytes of a grid as numbers, row by row.
CREATE MACRO counts_of(grid) AS
    list_transform(regexp_extract_all(hex(grid), '..'), lambda byte: CAST('0x' || byte AS UTINYINT));

-- The signed bytes of a grid as numbers, row by row.
CREATE MACRO signed_counts_of(grid) AS
    list_transform(counts_of(grid), lambda byte: CAST(CASE WHEN byte > 127 THEN byte - 256::SMALLINT ELSE byte END AS TINYINT));

-- The number of a sensor in the rig of a calibration: `calibrated_as` follows the sensors of a rig, S_0 first where it
-- has a LiDAR; NULL where they have the same numbers.
CREATE MACRO number_there(sensor, lidar, calibrated_as) AS
    coalesce(calibrated_as[sensor + CASE WHEN lidar THEN 1 ELSE 0 END], sensor);
