-- Sweeps and runs by number; runs that several sweeps share; verbs, priorities, tags; files that hold
-- many chunks. Counts are kept per state, so that they add up by moving runs from one to another.

ALTER TABLE sweeps RENAME TO old_sweeps;
ALTER TABLE chunks RENAME TO old_chunks;
ALTER TABLE tallies RENAME TO old_tallies;
ALTER TABLE files RENAME TO old_files;
ALTER TABLE runs RENAME TO old_runs;
DROP INDEX chunks_by_state;
DROP INDEX runs_by_id;
DROP INDEX runs_by_status;

CREATE TABLE sweeps (
    sweep BIGINT NOT NULL PRIMARY KEY,
    id TEXT NOT NULL UNIQUE,
    name TEXT NOT NULL,
    -- Parameters that vary, with commas between. Up to four of them are the columns axis_1 to axis_4 of
    -- runs, in the order of the table of parameters.
    axis_names TEXT NOT NULL,
    priority BIGINT NOT NULL,
    is_forced BIGINT NOT NULL,
    -- open and paused wait for chunks, stopping for those under way, ended for nothing; deleted is being
    -- cleared away.
    phase TEXT NOT NULL CHECK (phase IN ('open', 'paused', 'stopping', 'ended', 'deleted')),
    total BIGINT NOT NULL,
    -- Runs taken over from other sweeps so far, and those found when it was submitted.
    reused BIGINT NOT NULL,
    found BIGINT NOT NULL,
    -- When it last had a chunk leased, counted in leases.
    turn BIGINT NOT NULL,
    is_compact BIGINT NOT NULL,
    idempotency_key TEXT UNIQUE,
    submission_digest TEXT,
    created_at TEXT NOT NULL
);
CREATE INDEX sweeps_by_phase ON sweeps (phase, is_compact);

-- Apart from their sweeps, whose rows every chunk writes to.
CREATE TABLE documents (
    sweep BIGINT NOT NULL PRIMARY KEY,
    document TEXT NOT NULL,
    -- The document without long lists; null where the document is short.
    summary TEXT
);

CREATE TABLE tags (
    sweep BIGINT NOT NULL,
    tag TEXT NOT NULL,
    PRIMARY KEY (sweep, tag)
);
CREATE INDEX tags_by_name ON tags (tag, sweep);

CREATE TABLE chunks (
    sweep BIGINT NOT NULL,
    chunk BIGINT NOT NULL,
    first_run BIGINT NOT NULL,
    end_run BIGINT NOT NULL,
    run_count BIGINT NOT NULL,
    state TEXT NOT NULL CHECK (state IN ('queued', 'leased', 'done', 'cancelled')),
    lease_token TEXT,
    ended_ms BIGINT,
    PRIMARY KEY (sweep, chunk)
);
CREATE INDEX chunks_by_state ON chunks (state, sweep, chunk);
CREATE INDEX chunks_by_end ON chunks (sweep, ended_ms);

CREATE TABLE tallies (
    sweep BIGINT NOT NULL,
    -- A status of a stored run, or queued, running, cancelled.
    status TEXT NOT NULL,
    runs BIGINT NOT NULL CHECK (runs >= 0),
    PRIMARY KEY (sweep, status)
);

CREATE TABLE files (
    path TEXT NOT NULL PRIMARY KEY,
    kind TEXT NOT NULL CHECK (kind IN ('runs', 'profiles', 'series')),
    blake3 TEXT NOT NULL,
    row_count BIGINT NOT NULL,
    byte_count BIGINT NOT NULL,
    schema_version BIGINT NOT NULL
);

-- Which rows of which file hold what a chunk solved.
CREATE TABLE parts (
    sweep BIGINT NOT NULL,
    chunk BIGINT NOT NULL,
    kind TEXT NOT NULL,
    path TEXT NOT NULL REFERENCES files (path),
    first_row BIGINT NOT NULL,
    row_count BIGINT NOT NULL,
    PRIMARY KEY (sweep, chunk, kind)
);
CREATE INDEX parts_by_path ON parts (path);

-- How many of a chunk's runs live in the files of which chunk: its own, or one of another sweep.
CREATE TABLE homes (
    sweep BIGINT NOT NULL,
    chunk BIGINT NOT NULL,
    home_sweep BIGINT NOT NULL,
    home_chunk BIGINT NOT NULL,
    runs BIGINT NOT NULL CHECK (runs > 0),
    first_index BIGINT NOT NULL,
    last_index BIGINT NOT NULL,
    -- Whether the home's rows are not one for each of these runs, in their order.
    is_mixed BIGINT NOT NULL,
    PRIMARY KEY (sweep, chunk, home_sweep, home_chunk)
);
CREATE INDEX homes_by_home ON homes (home_sweep, home_chunk);

CREATE TABLE runs (
    sweep BIGINT NOT NULL,
    run_index BIGINT NOT NULL,
    run_id TEXT NOT NULL,
    chunk BIGINT NOT NULL,
    home_sweep BIGINT NOT NULL,
    home_chunk BIGINT NOT NULL,
    status TEXT NOT NULL,
    detail TEXT NOT NULL,
    regime TEXT NOT NULL,
    upstream_closure TEXT NOT NULL,
    root_evidence TEXT,
    validity TEXT,
    grid_convergence TEXT,
    -- Residual norms of a failed run's last attempt, as a JSON list.
    residual_history TEXT,
    iterations BIGINT NOT NULL,
    attempts BIGINT,
    axis_1 DOUBLE PRECISION,
    axis_2 DOUBLE PRECISION,
    axis_3 DOUBLE PRECISION,
    axis_4 DOUBLE PRECISION,
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
    terminus_x_m DOUBLE PRECISION,
    inflow_m3_per_a DOUBLE PRECISION,
    melt_m3_per_a DOUBLE PRECISION,
    outflow_m3_per_a DOUBLE PRECISION,
    strain_rate_0_per_a DOUBLE PRECISION,
    strain_rate_min_per_a DOUBLE PRECISION,
    inertial_number DOUBLE PRECISION,
    cfl_time_step_a DOUBLE PRECISION,
    cfl_number DOUBLE PRECISION,
    grid_error_length_m DOUBLE PRECISION,
    grid_error_thickness_0_m DOUBLE PRECISION,
    grid_error_force_n_per_m DOUBLE PRECISION,
    PRIMARY KEY (sweep, run_index)
);

INSERT INTO sweeps (sweep, id, name, axis_names, priority, is_forced, phase, total, reused,
    found, turn, is_compact, created_at)
SELECT ROW_NUMBER() OVER (ORDER BY o.id), o.id, o.name, '', 0, 0,
    CASE WHEN EXISTS (SELECT 1 FROM old_chunks c WHERE c.sweep_id = o.id AND c.state <> 'done')
        THEN 'open' ELSE 'ended' END,
    o.total, 0, 0, 0, 0, o.created_at
FROM old_sweeps o;

INSERT INTO documents (sweep, document)
SELECT s.sweep, o.document FROM old_sweeps o JOIN sweeps s ON s.id = o.id;

INSERT INTO chunks (sweep, chunk, first_run, end_run, run_count, state, lease_token, ended_ms)
SELECT s.sweep, c.chunk, c.first_run, c.first_run + c.run_count, c.run_count,
    CASE WHEN c.state = 'done' THEN 'done' ELSE 'queued' END, NULL, NULL
FROM old_chunks c JOIN sweeps s ON s.id = c.sweep_id;

INSERT INTO tallies (sweep, status, runs)
SELECT s.sweep, t.status, t.runs FROM old_tallies t JOIN sweeps s ON s.id = t.sweep_id;

INSERT INTO tallies (sweep, status, runs)
SELECT sweep, 'queued', SUM(run_count) FROM chunks WHERE state = 'queued' GROUP BY sweep;

INSERT INTO files (path, kind, blake3, row_count, byte_count, schema_version)
SELECT path, kind, blake3, row_count, byte_count, schema_version FROM old_files;

INSERT INTO parts (sweep, chunk, kind, path, first_row, row_count)
SELECT s.sweep, f.chunk, f.kind, f.path, 0, f.row_count
FROM old_files f JOIN sweeps s ON s.id = f.sweep_id;

INSERT INTO runs (sweep, run_index, run_id, chunk, home_sweep, home_chunk, status, detail, regime,
    upstream_closure, root_evidence, validity, grid_convergence, iterations,
    terminus_velocity_m_per_a, calving_rate_m_per_a, terminus_thickness_m, melt_rate_m_per_day, width_m,
    width_gradient, d_m, "b", "A", mu_s, strain_rate_regularisation_per_a, water_drag_n_per_m, n_cells,
    length_m, thickness_0_m, force_n_per_m, force_quasi_static_n_per_m, velocity_end_m_per_a, volume_m3,
    residual_norm, mass_budget_defect, yielding_fraction, end_time_a, terminus_x_m, inflow_m3_per_a,
    melt_m3_per_a, outflow_m3_per_a, strain_rate_0_per_a, strain_rate_min_per_a, inertial_number,
    cfl_time_step_a, cfl_number, grid_error_length_m, grid_error_thickness_0_m, grid_error_force_n_per_m)
SELECT s.sweep, r.run_index, r.run_id, r.chunk, s.sweep, r.chunk, r.status, r.detail, r.regime,
    r.upstream_closure, r.root_evidence, r.validity, r.grid_convergence, r.iterations,
    r.terminus_velocity_m_per_a, r.calving_rate_m_per_a, r.terminus_thickness_m, r.melt_rate_m_per_day,
    r.width_m, r.width_gradient, r.d_m, r."b", r."A", r.mu_s, r.strain_rate_regularisation_per_a,
    r.water_drag_n_per_m, r.n_cells, r.length_m, r.thickness_0_m, r.force_n_per_m,
    r.force_quasi_static_n_per_m, r.velocity_end_m_per_a, r.volume_m3, r.residual_norm,
    r.mass_budget_defect, r.yielding_fraction, r.end_time_a, r.terminus_x_m, r.inflow_m3_per_a,
    r.melt_m3_per_a, r.outflow_m3_per_a, r.strain_rate_0_per_a, r.strain_rate_min_per_a,
    r.inertial_number, r.cfl_time_step_a, r.cfl_number, r.grid_error_length_m,
    r.grid_error_thickness_0_m, r.grid_error_force_n_per_m
FROM old_runs r JOIN sweeps s ON s.id = r.sweep_id;

INSERT INTO homes (sweep, chunk, home_sweep, home_chunk, runs, first_index, last_index, is_mixed)
SELECT sweep, chunk, home_sweep, home_chunk, COUNT(*), MIN(run_index), MAX(run_index), 0
FROM runs GROUP BY sweep, chunk, home_sweep, home_chunk;

CREATE INDEX runs_by_id ON runs (run_id);
-- With the index of the run, these hold all that a page in the order of the runs asks for.
CREATE INDEX runs_by_status ON runs (sweep, status, run_index);
CREATE INDEX runs_by_axis_1 ON runs (sweep, axis_1, run_index);
CREATE INDEX runs_by_axis_2 ON runs (sweep, axis_2, run_index);
CREATE INDEX runs_by_axis_3 ON runs (sweep, axis_3, run_index);
CREATE INDEX runs_by_axis_4 ON runs (sweep, axis_4, run_index);
CREATE INDEX runs_by_force ON runs (sweep, force_n_per_m, run_index);

DROP TABLE old_runs;
DROP TABLE old_files;
DROP TABLE old_tallies;
DROP TABLE old_chunks;
DROP TABLE old_sweeps;
