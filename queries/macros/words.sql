-- Structured columns of verdicts in words.

-- One piece of evidence in words, without its score: of sensor i, or of a pair (i, k), of which verdicts of before
-- checks of sensors know no other; of a check as it is declared (see the view checks), else of a triple.
CREATE MACRO check_in_words(check_name, i, j, k) AS coalesce(
    replace(replace(evidence_template(check_name, k IS NOT NULL), '{i}', i::VARCHAR), '{k}', coalesce(k, i)::VARCHAR),
    'E_' || i || ',' || j || ',' || k || ' above theta'
);

-- The evidence of a verdict, the strongest first, what several views or checks say once; NULL where there is none.
CREATE MACRO evidence_in_words(evidence) AS
    nullif(array_to_string(list_transform(
        list_filter(evidence, lambda x, place: list_position(
            list_transform(evidence, lambda y: check_in_words(y['check_name'], y['i'], y['j'], y['k'])),
            check_in_words(x['check_name'], x['i'], x['j'], x['k'])
        ) = place),
        lambda x: check_in_words(x['check_name'], x['i'], x['j'], x['k']) || format(' ({:+.2f})', x['score'])
    ), ', '), '');

-- Evidence in words, in which the recording's own name follows the number of each sensor; `sensors` are a rig's.
CREATE MACRO with_names(told, sensors) AS
    list_reduce(
        list_prepend(told, list_transform(sensors, lambda s: 'S_' || s['sensor'] || ' ' || s['name'])),
        lambda words, named: replace(words, split_part(named, ' ', 1) || ' ', named || ' ')
    );

-- Sensors as 'S_1 and S_2', or what their absence means.
CREATE MACRO sensors_in_words(sensors, if_none) AS
    CASE WHEN len(sensors) = 0 THEN if_none ELSE array_to_string(list_transform(sensors, lambda s: 'S_' || s), ' and ') END;

-- A probability in per cent, none as certain or impossible.
CREATE MACRO share_in_words(share) AS
    CASE
        WHEN share < 0.01 THEN 'under 1 %'
        WHEN share > 0.99 THEN 'over 99 %'
        ELSE format('{:.0f} %', 100 * share)
    END;

-- The ratio of a logarithm to two digits.
CREATE MACRO ratio_figure(log10_ratio) AS format('{:g}', round(pow(10, log10_ratio), 1 - floor(log10_ratio)::INTEGER));

-- The next-best explanations, the next best first, with their probabilities where that of the best is known; else by
-- how much they are worse. NULL where there is none.
CREATE MACRO alternatives_in_words(alternatives, posterior) AS
    nullif(array_to_string(list_transform(
        alternatives,
        lambda x: sensors_in_words(x['attacked'], 'no attack') || CASE
            WHEN posterior IS NULL THEN format(' (worse by {:.2f})', x['worse_by'])
            ELSE format(' ({})', share_in_words(posterior / pow(10, x['worse_by'])))
        END
    ), ', '), '');

-- A likelihood ratio, in the words of ENFSI's guideline of 2015 for evaluative reporting; `largest` is what can be said.
-- A suspect finding claims no attack: a fault explains it too.
CREATE MACRO ratio_in_words(log10_ratio, largest, kind) AS
    CASE WHEN log10_ratio >= log10(largest) - 1e-9 THEN 'more than ' ELSE 'about ' END
    || format('{} times as likely {}: {}', ratio_figure(log10_ratio), CASE kind
        WHEN 'suspect' THEN 'with an attack or a fault as with neither'
        ELSE 'under the attack as without'
    END, CASE
        WHEN log10_ratio < log10(2) THEN 'no support'
        WHEN log10_ratio < 1 THEN 'weak support'
        WHEN log10_ratio < 2 THEN 'moderate support'
        WHEN log10_ratio < 3 THEN 'moderately strong support'
        WHEN log10_ratio < 4 THEN 'strong support'
        WHEN log10_ratio < 6 THEN 'very strong support'
        ELSE 'extremely strong support'
    END);

-- One cause that is not an attack in words.
CREATE MACRO cause_in_words(cause, sensor) AS
    CASE cause
        WHEN 'frozen' THEN 'S_' || sensor || ' repeats what it showed before while others go on'
        WHEN 'late' THEN 'S_' || sensor || ' lags by a frame'
        WHEN 'displaced' THEN 'S_' || sensor || ' has turned since it was calibrated'
        WHEN 'soiled' THEN 'something changes what S_' || sensor || ' sees, as dirt or drops on its lens do'
        WHEN 'blurred' THEN 'S_' || sensor || ' shows far less detail than the others, as out of focus or behind fog'
        WHEN 'blind' THEN 'S_' || sensor || ' shows hardly any of the detail that others do, or it did seconds before or after, as dazzled or covered'
        WHEN 'exposure' THEN 'S_' || sensor || ' as a whole is brighter or darker than usual beside the others'
        WHEN 'white_balance' THEN 'S_' || sensor || ' as a whole is redder or bluer than usual beside the others'
        WHEN 'dark' THEN 'all cameras are dark'
        WHEN 'glare' THEN 'light scatters in the lens of S_' || sensor || ', as that of the sun does'
        WHEN 'rain' THEN 'S_' || sensor || ' sees drops all around, as in rain'
        WHEN 'aerosol' THEN 'S_' || sensor || ' has returns that scatter, as in dust, steam or exhaust'
    END;

-- What else than an attack may lie behind one verdict or several, each cause once with its best score, the likeliest
-- first; NULL where nothing is known.
CREATE MACRO causes_in_words(causes) AS
    nullif(array_to_string(list_transform(
        list_reverse_sort(list_transform(
            list_distinct(list_transform(
                causes, lambda x: {'words': cause_in_words(x['cause'], x['sensor'])}
            )),
            lambda one: {
                'score': list_max(list_transform(
                    list_filter(causes, lambda x: cause_in_words(x['cause'], x['sensor']) = one['words']),
                    lambda x: x['score']
                )),
                'words': one['words']
            }
        )),
        lambda one: one['words'] || format(' (score {:.2f} of 1)', one['score'])
    ), ', '), '');
