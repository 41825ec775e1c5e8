-- People, their tokens, sessions of browsers, what was changed by whom; owners of sweeps; the trash.

CREATE TABLE people (
    name TEXT NOT NULL PRIMARY KEY,
    role TEXT NOT NULL CHECK (role IN ('reader', 'contributor', 'admin')),
    -- Hash of the token; null when revoked. A person who is revoked stays listed: what they did is told by
    -- their name, and a service that had people never becomes an open one again.
    token_hash TEXT UNIQUE,
    created_at TEXT NOT NULL,
    revoked_at TEXT,
    -- Most runs of all their sweeps together, and most of them waiting or under way; null for no limit.
    most_runs BIGINT,
    most_pending_runs BIGINT
);

-- A browser that was logged in with a token.
CREATE TABLE sessions (
    session_hash TEXT NOT NULL PRIMARY KEY,
    name TEXT NOT NULL REFERENCES people (name),
    expires_ms BIGINT NOT NULL
);

-- Every change: who, when, what, on what. Written in the transaction of the change itself.
CREATE TABLE audit (
    entry BIGINT NOT NULL PRIMARY KEY,
    changed_at TEXT NOT NULL,
    who TEXT NOT NULL,
    action TEXT NOT NULL,
    subject TEXT NOT NULL,
    detail TEXT
);
CREATE INDEX audit_by_subject ON audit (subject, entry);
CREATE INDEX audit_by_who ON audit (who, entry);

-- Who submitted a sweep: null for those from before there were owners.
ALTER TABLE sweeps ADD COLUMN owner TEXT;
-- Since when it lies in the trash, ms since 1970; null if it does not.
ALTER TABLE sweeps ADD COLUMN trashed_ms BIGINT;
CREATE INDEX sweeps_by_owner ON sweeps (owner, sweep);
CREATE INDEX sweeps_by_trash ON sweeps (trashed_ms);
