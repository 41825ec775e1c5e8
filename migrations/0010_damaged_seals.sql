-- A sealed sweep's file that is damaged is put back by hand. Until then nobody takes its runs over.
ALTER TABLE seals ADD COLUMN is_damaged BIGINT NOT NULL DEFAULT 0;
