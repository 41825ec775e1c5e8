-- Sealed sweeps, sweeps that came from elsewhere, and tables of somebody's earlier results.

-- A sealed sweep never changes again: its runs live in its own files only.
CREATE TABLE seals (
    sweep BIGINT NOT NULL PRIMARY KEY,
    content_hash TEXT NOT NULL,
    -- As JSON: what it is cited by, and its files with their hashes.
    manifest TEXT NOT NULL,
    -- What was solved, byte for byte as it was hashed.
    spec TEXT NOT NULL
);
CREATE INDEX seals_by_hash ON seals (content_hash, sweep);

-- The file that is the whole of a sealed sweep's table.
CREATE TABLE sealed_files (
    sweep BIGINT NOT NULL,
    kind TEXT NOT NULL,
    path TEXT NOT NULL REFERENCES files (path),
    PRIMARY KEY (sweep, kind)
);
CREATE INDEX sealed_files_by_path ON sealed_files (path);

-- Sweeps that came from another data directory.
CREATE TABLE imports (
    sweep BIGINT NOT NULL PRIMARY KEY,
    content_hash TEXT NOT NULL,
    source_id TEXT NOT NULL,
    source_owner TEXT,
    imported_at TEXT NOT NULL,
    imported_by TEXT NOT NULL
);
CREATE INDEX imports_by_hash ON imports (content_hash, sweep);

-- Somebody's earlier results, for comparison; never taken for runs.
CREATE TABLE foreign_tables (
    number BIGINT NOT NULL PRIMARY KEY,
    id TEXT NOT NULL UNIQUE,
    name TEXT NOT NULL,
    -- Who computed it, when, by which code.
    source TEXT NOT NULL,
    owner TEXT NOT NULL,
    created_at TEXT NOT NULL,
    -- Hash of the table and the column map as they were sent.
    digest TEXT NOT NULL,
    -- The column map, as JSON.
    map TEXT NOT NULL,
    row_count BIGINT NOT NULL
);

-- A row's parameters and results by name, as JSON objects.
CREATE TABLE foreign_rows (
    number BIGINT NOT NULL,
    row_index BIGINT NOT NULL,
    parameters TEXT NOT NULL,
    results TEXT NOT NULL,
    PRIMARY KEY (number, row_index)
);
