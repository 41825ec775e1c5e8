-- Runs of a sweep that varies two parameters have nothing in the third axis: no index needs to say so.

DROP INDEX runs_by_axis_1;
DROP INDEX runs_by_axis_2;
DROP INDEX runs_by_axis_3;
DROP INDEX runs_by_axis_4;
CREATE INDEX runs_by_axis_1 ON runs (sweep, axis_1, run_index) WHERE axis_1 IS NOT NULL;
CREATE INDEX runs_by_axis_2 ON runs (sweep, axis_2, run_index) WHERE axis_2 IS NOT NULL;
CREATE INDEX runs_by_axis_3 ON runs (sweep, axis_3, run_index) WHERE axis_3 IS NOT NULL;
CREATE INDEX runs_by_axis_4 ON runs (sweep, axis_4, run_index) WHERE axis_4 IS NOT NULL;
