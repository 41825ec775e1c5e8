-- Sweeps and their chunks (the queue), and the catalogue of what the archive holds.
-- Types are TEXT, BIGINT and DOUBLE PRECISION only: what SQLite and PostgreSQL both understand.

CREATE TABLE sweeps (
    id TEXT PRIMARY KEY,
    name TEXT NOT NULL,
    document TEXT NOT NULL,
    total BIGINT NOT NULL,
    created_at TEXT NOT NULL
);

CREATE TABLE chunks (
    sweep_id TEXT NOT NULL REFERENCES sweeps (id),
    chunk BIGINT NOT NULL,
    first_run BIGINT NOT NULL,
    run_count BIGINT NOT NULL,
    state TEXT NOT NULL CHECK (state IN ('queued', 'leased', 'done')),
    lease_token TEXT,
    PRIMARY KEY (sweep_id, chunk)
);

CREATE INDEX chunks_by_state ON chunks (state, sweep_id, chunk);

-- Runs of a sweep by status, kept up to date in the transaction that stores a chunk.
CREATE TABLE tallies (
    sweep_id TEXT NOT NULL REFERENCES sweeps (id),
    status TEXT NOT NULL,
    runs BIGINT NOT NULL,
    PRIMARY KEY (sweep_id, status)
);

CREATE TABLE files (
    path TEXT PRIMARY KEY,
    sweep_id TEXT NOT NULL REFERENCES sweeps (id),
    chunk BIGINT NOT NULL,
    kind TEXT NOT NULL CHECK (kind IN ('runs', 'profiles', 'series')),
    blake3 TEXT NOT NULL,
    row_count BIGINT NOT NULL,
    byte_count BIGINT NOT NULL,
    schema_version BIGINT NOT NULL,
    UNIQUE (sweep_id, chunk, kind)
);

CREATE TABLE runs (
    sweep_id TEXT NOT NULL REFERENCES sweeps (id),
    run_index BIGINT NOT NULL,
    run_id TEXT NOT NULL,
    chunk BIGINT NOT NULL,
    status TEXT NOT NULL,
    detail TEXT NOT NULL,
    regime TEXT NOT NULL,
    upstream_closure TEXT NOT NULL,
    root_evidence TEXT,
    iterations BIGINT NOT NULL,
    terminus_velocity_m_per_a DOUBLE PRECISION NOT NULL,
    calving_rate_m_per_a DOUBLE PRECISION NOT NULL,
    terminus_thickness_m DOUBLE PRECISION NOT NULL,
    melt_rate_m_per_day DOUBLE PRECISION NOT NULL,
    width_m DOUBLE PRECISION NOT NULL,
    width_gradient DOUBLE PRECISION NOT NULL,
    d_m DOUBLE PRECISION NOT NULL,
    "b" DOUBLE PRECISION NOT NULL,
    "A" DOUBLE PRECISION NOT NULL,
    mu_s DOUBLE PRECISION NOT NULL,
    strain_rate_regularisation_per_a DOUBLE PRECISION NOT NULL,
    water_drag_n_per_m DOUBLE PRECISION NOT NULL,
    n_cells DOUBLE PRECISION NOT NULL,
    length_m DOUBLE PRECISION,
    thickness_0_m DOUBLE PRECISION,
    force_n_per_m DOUBLE PRECISION,
    force_quasi_static_n_per_m DOUBLE PRECISION,
    velocity_end_m_per_a DOUBLE PRECISION,
    volume_m3 DOUBLE PRECISION,
    residual_norm DOUBLE PRECISION,
    mass_budget_defect DOUBLE PRECISION,
    yielding_fraction DOUBLE PRECISION,
    end_time_a DOUBLE PRECISION,
    PRIMARY KEY (sweep_id, run_index)
);

CREATE INDEX runs_by_id ON runs (run_id);
CREATE INDEX runs_by_status ON runs (sweep_id, status);

-- Seconds per unit of work (cells, times steps), measured; sizes the chunks of later sweeps.
CREATE TABLE measured_rates (
    regime TEXT PRIMARY KEY,
    seconds_per_unit DOUBLE PRECISION NOT NULL
);
