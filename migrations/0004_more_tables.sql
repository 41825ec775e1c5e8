-- Files of more tables than runs, profiles and series. Which tables there are is the program's to say; a file
-- of a table that a version does not know has a newer schema version, which that version refuses.

ALTER TABLE parts RENAME TO old_parts;
ALTER TABLE files RENAME TO old_files;
DROP INDEX parts_by_path;

CREATE TABLE files (
    path TEXT NOT NULL PRIMARY KEY,
    kind TEXT NOT NULL,
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

INSERT INTO files (path, kind, blake3, row_count, byte_count, schema_version)
SELECT path, kind, blake3, row_count, byte_count, schema_version FROM old_files;

INSERT INTO parts (sweep, chunk, kind, path, first_row, row_count)
SELECT sweep, chunk, kind, path, first_row, row_count FROM old_parts;

DROP TABLE old_parts;
DROP TABLE old_files;
