-- Where results come from: which program on which host solved a chunk, and when; how long each run took. What is
-- the same for all runs of a chunk is told once; the rest stands in the files.

CREATE TABLE provenances (
    number BIGINT NOT NULL PRIMARY KEY,
    model_version TEXT NOT NULL,
    program_version TEXT NOT NULL,
    host_class TEXT NOT NULL,
    UNIQUE (model_version, program_version, host_class)
);

-- Of the runs that a chunk solved itself; a chunk solved by an older version has no row.
CREATE TABLE solved (
    sweep BIGINT NOT NULL,
    chunk BIGINT NOT NULL,
    provenance BIGINT NOT NULL REFERENCES provenances (number),
    -- RFC 3339 in UTC.
    solved_at TEXT NOT NULL,
    PRIMARY KEY (sweep, chunk)
);

ALTER TABLE runs ADD COLUMN solve_seconds DOUBLE PRECISION;
