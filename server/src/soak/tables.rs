//! The tables that a service hands out, read back: which runs they hold, in which order, how often.

use anyhow::Context;
use arrow_array::{Int64Array, RecordBatch, StringArray};
use bytes::Bytes;
use parquet::arrow::arrow_reader::ParquetRecordBatchReaderBuilder;

/// A table that was read to its end, all columns of it.
#[derive(Debug)]
pub struct Table {
    batches: Vec<RecordBatch>,
}

impl Table {
    /// From the bytes of a Parquet file.
    pub fn read(bytes: Vec<u8>) -> anyhow::Result<Self> {
        let builder = ParquetRecordBatchReaderBuilder::try_new(Bytes::from(bytes))?;
        Ok(Self { batches: builder.build()?.collect::<Result<_, _>>()? })
    }

    fn column<A: 'static>(&self, name: &str) -> anyhow::Result<Vec<&A>> {
        let of = |batch: &'_ RecordBatch| batch.column_by_name(name).map(|c| c.as_any().is::<A>());
        anyhow::ensure!(
            self.batches.iter().all(|b| of(b) == Some(true)),
            "the table has no column {name}"
        );
        let columns = self.batches.iter().filter_map(|b| b.column_by_name(name));
        columns.map(|c| c.as_any().downcast_ref().context("another type")).collect()
    }

    /// The runs' ids, row by row.
    pub fn ids(&self) -> anyhow::Result<Vec<&str>> {
        let columns: Vec<&StringArray> = self.column("run_id")?;
        Ok(columns.into_iter().flat_map(|column| column.iter().flatten()).collect())
    }

    /// The runs' indices, row by row.
    pub fn indices(&self) -> anyhow::Result<Vec<i64>> {
        let columns: Vec<&Int64Array> = self.column("run_index")?;
        Ok(columns.into_iter().flat_map(|column| column.values().to_vec()).collect())
    }
}

/// What is wrong with a table of runs that should hold each of `total` once, in their order.
pub fn fault_of_runs(runs: &Table, total: i64) -> anyhow::Result<Option<String>> {
    let indices = runs.indices()?;
    let odd = indices.iter().zip(0..).find(|(index, row)| *index != row);
    Ok(match odd {
        Some((index, row)) => Some(format!("row {row} is run {index}")),
        None if indices.len() as i64 != total => {
            Some(format!("there are {} rows of {total}", indices.len()))
        }
        None => None,
    })
}

/// What is wrong with a table that should hold the same number of rows of each run, in their order.
pub fn fault_of_rows(table: &Table, runs: &Table) -> anyhow::Result<Option<String>> {
    let (ids, rows) = (runs.ids()?, table.ids()?);
    let each = rows.len() / ids.len().max(1);
    if each == 0 || each * ids.len() != rows.len() {
        return Ok(Some(format!("{} runs have {} rows", ids.len(), rows.len())));
    }
    let odd = rows.chunks(each).zip(&ids).find(|(rows, id)| rows.iter().any(|row| row != *id));
    Ok(odd.map(|(_, id)| format!("run {id} does not have {each} rows in its place")))
}
