-- What sweeps are found by: the ranges of their runs' parameters, their regime, notes.

-- What a sweep solves for; null for an older one that nothing tells it of.
ALTER TABLE sweeps ADD COLUMN regime TEXT;
-- Markdown, as it was written; null if there is none.
ALTER TABLE sweeps ADD COLUMN note TEXT;

-- The least and the greatest value of a parameter among all runs of a sweep, also those that have no result yet.
-- Older sweeps whose runs are not all there have none, and are never ruled out by them.
CREATE TABLE sweep_ranges (
    parameter TEXT NOT NULL,
    sweep BIGINT NOT NULL,
    low DOUBLE PRECISION NOT NULL,
    high DOUBLE PRECISION NOT NULL,
    PRIMARY KEY (parameter, sweep)
);

-- Documents are JSON without blanks, in which a quote within a text has a backslash before it.
UPDATE sweeps SET regime = (
    SELECT CASE
        WHEN d.document LIKE '%"regime":"steady"%' THEN 'steady'
        WHEN d.document LIKE '%"regime":"diagnostic"%' THEN 'diagnostic'
        WHEN d.document LIKE '%"regime":"transient"%' THEN 'transient'
        WHEN d.document LIKE '%"regime":"quasi_static"%' THEN 'quasi_static'
        WHEN d.document LIKE '%"regime":"branch"%' THEN 'branch'
        WHEN d.document LIKE '%"regime":"fold_curve"%' THEN 'fold_curve'
        WHEN d.document LIKE '%"regime":"calibration"%' THEN 'calibration'
    END
    FROM documents d WHERE d.sweep = sweeps.sweep);

CREATE TABLE whole_sweeps (
    sweep BIGINT NOT NULL PRIMARY KEY,
    "terminus_velocity_m_per_a_low" DOUBLE PRECISION NOT NULL, "terminus_velocity_m_per_a_high" DOUBLE PRECISION NOT NULL,
    "calving_rate_m_per_a_low" DOUBLE PRECISION NOT NULL, "calving_rate_m_per_a_high" DOUBLE PRECISION NOT NULL,
    "terminus_thickness_m_low" DOUBLE PRECISION NOT NULL, "terminus_thickness_m_high" DOUBLE PRECISION NOT NULL,
    "melt_rate_m_per_day_low" DOUBLE PRECISION NOT NULL, "melt_rate_m_per_day_high" DOUBLE PRECISION NOT NULL,
    "width_m_low" DOUBLE PRECISION NOT NULL, "width_m_high" DOUBLE PRECISION NOT NULL,
    "width_gradient_low" DOUBLE PRECISION NOT NULL, "width_gradient_high" DOUBLE PRECISION NOT NULL,
    "d_m_low" DOUBLE PRECISION NOT NULL, "d_m_high" DOUBLE PRECISION NOT NULL,
    "b_low" DOUBLE PRECISION NOT NULL, "b_high" DOUBLE PRECISION NOT NULL,
    "A_low" DOUBLE PRECISION NOT NULL, "A_high" DOUBLE PRECISION NOT NULL,
    "mu_s_low" DOUBLE PRECISION NOT NULL, "mu_s_high" DOUBLE PRECISION NOT NULL,
    "strain_rate_regularisation_per_a_low" DOUBLE PRECISION NOT NULL, "strain_rate_regularisation_per_a_high" DOUBLE PRECISION NOT NULL,
    "water_drag_n_per_m_low" DOUBLE PRECISION NOT NULL, "water_drag_n_per_m_high" DOUBLE PRECISION NOT NULL,
    "n_cells_low" DOUBLE PRECISION NOT NULL, "n_cells_high" DOUBLE PRECISION NOT NULL
);
INSERT INTO whole_sweeps
SELECT r.sweep,
    MIN(r."terminus_velocity_m_per_a"), MAX(r."terminus_velocity_m_per_a"),
    MIN(r."calving_rate_m_per_a"), MAX(r."calving_rate_m_per_a"),
    MIN(r."terminus_thickness_m"), MAX(r."terminus_thickness_m"),
    MIN(r."melt_rate_m_per_day"), MAX(r."melt_rate_m_per_day"),
    MIN(r."width_m"), MAX(r."width_m"),
    MIN(r."width_gradient"), MAX(r."width_gradient"),
    MIN(r."d_m"), MAX(r."d_m"),
    MIN(r."b"), MAX(r."b"),
    MIN(r."A"), MAX(r."A"),
    MIN(r."mu_s"), MAX(r."mu_s"),
    MIN(r."strain_rate_regularisation_per_a"), MAX(r."strain_rate_regularisation_per_a"),
    MIN(r."water_drag_n_per_m"), MAX(r."water_drag_n_per_m"),
    MIN(r."n_cells"), MAX(r."n_cells")
FROM runs r JOIN sweeps s ON s.sweep = r.sweep GROUP BY r.sweep, s.total HAVING COUNT(*) = s.total;

INSERT INTO sweep_ranges (parameter, sweep, low, high)
SELECT 'terminus_velocity_m_per_a', sweep, "terminus_velocity_m_per_a_low", "terminus_velocity_m_per_a_high" FROM whole_sweeps;
INSERT INTO sweep_ranges (parameter, sweep, low, high)
SELECT 'calving_rate_m_per_a', sweep, "calving_rate_m_per_a_low", "calving_rate_m_per_a_high" FROM whole_sweeps;
INSERT INTO sweep_ranges (parameter, sweep, low, high)
SELECT 'terminus_thickness_m', sweep, "terminus_thickness_m_low", "terminus_thickness_m_high" FROM whole_sweeps;
INSERT INTO sweep_ranges (parameter, sweep, low, high)
SELECT 'melt_rate_m_per_day', sweep, "melt_rate_m_per_day_low", "melt_rate_m_per_day_high" FROM whole_sweeps;
INSERT INTO sweep_ranges (parameter, sweep, low, high)
SELECT 'width_m', sweep, "width_m_low", "width_m_high" FROM whole_sweeps;
INSERT INTO sweep_ranges (parameter, sweep, low, high)
SELECT 'width_gradient', sweep, "width_gradient_low", "width_gradient_high" FROM whole_sweeps;
INSERT INTO sweep_ranges (parameter, sweep, low, high)
SELECT 'd_m', sweep, "d_m_low", "d_m_high" FROM whole_sweeps;
INSERT INTO sweep_ranges (parameter, sweep, low, high)
SELECT 'b', sweep, "b_low", "b_high" FROM whole_sweeps;
INSERT INTO sweep_ranges (parameter, sweep, low, high)
SELECT 'A', sweep, "A_low", "A_high" FROM whole_sweeps;
INSERT INTO sweep_ranges (parameter, sweep, low, high)
SELECT 'mu_s', sweep, "mu_s_low", "mu_s_high" FROM whole_sweeps;
INSERT INTO sweep_ranges (parameter, sweep, low, high)
SELECT 'strain_rate_regularisation_per_a', sweep, "strain_rate_regularisation_per_a_low", "strain_rate_regularisation_per_a_high" FROM whole_sweeps;
INSERT INTO sweep_ranges (parameter, sweep, low, high)
SELECT 'water_drag_n_per_m', sweep, "water_drag_n_per_m_low", "water_drag_n_per_m_high" FROM whole_sweeps;
INSERT INTO sweep_ranges (parameter, sweep, low, high)
SELECT 'n_cells', sweep, "n_cells_low", "n_cells_high" FROM whole_sweeps;
DROP TABLE whole_sweeps;
