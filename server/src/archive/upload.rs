//! A sweep's table from an uploaded Parquet file. Knows nothing of what is kept.

use crate::domain::refusal::Refusal;
use crate::domain::run::closure_of_name;
use crate::domain::table::{CLOSURE, Cells, TableForm};
use arrow_array::cast::AsArray;
use arrow_array::types::{
    Float32Type, Float64Type, Int8Type, Int16Type, Int32Type, Int64Type, UInt8Type, UInt16Type,
    UInt32Type, UInt64Type,
};
use arrow_array::{Array, ArrowPrimitiveType};
use arrow_schema::DataType;
use bytes::Bytes;
use parquet::arrow::arrow_reader::ParquetRecordBatchReaderBuilder;
use std::sync::Arc;

/// Bytes that a cell takes at most when unpacked: the longest name of a closure with its length, and its
/// place in a dictionary.
const BYTES_PER_CELL: i64 = 32;
/// Bytes that a stretch of a column takes beside its cells.
const SLACK: i64 = 1 << 16;

/// The table in a Parquet file, its columns by name: numbers of any width, and texts in the column
/// `upstream_closure`. A small file can stand for very much: what it says of itself is checked before it is
/// unpacked, and what comes out while it is.
pub fn from_parquet(bytes: Bytes, most_rows: usize) -> Result<TableForm, Refusal> {
    let unreadable = |error: &dyn std::error::Error| Refusal {
        field: Some("table".into()),
        permitted: Some("a Parquet file, plain or compressed with snappy or zstd".into()),
        ..Refusal::sentence(format!("the table is not readable as Parquet: {error}"))
    };
    let builder = ParquetRecordBatchReaderBuilder::try_new(bytes).map_err(|e| unreadable(&e))?;
    let too_many =
        |rows: i64| Err(Refusal::value("table.rows", rows, format!("at most {most_rows} rows")));
    let rows = builder.metadata().file_metadata().num_rows();
    if !(0..=most_rows as i64).contains(&rows) {
        return too_many(rows);
    }
    let names: Vec<String> = builder.schema().fields().iter().map(|f| f.name().clone()).collect();
    TableForm::check_names(&names)?;
    let groups = builder.metadata().row_groups();
    for column in groups.iter().flat_map(|group| group.columns()) {
        let (bytes, most) = (column.uncompressed_size(), SLACK + BYTES_PER_CELL * rows);
        if !(0..=most).contains(&bytes) {
            let permitted = format!("at most {most} bytes for {rows} rows");
            return Err(Refusal::value("table.columns", bytes, permitted));
        }
    }
    let mut columns: Vec<Cells> = names
        .iter()
        .map(|name| match name.as_str() {
            CLOSURE => Cells::Closures(Arc::default()),
            _ => Cells::Numbers(Arc::default()),
        })
        .collect();
    let mut rows_before = 0;
    for batch in builder.build().map_err(|e| unreadable(&e))? {
        let batch = batch.map_err(|e| unreadable(&e))?;
        if rows_before + batch.num_rows() > most_rows {
            return too_many((rows_before + batch.num_rows()) as i64);
        }
        for (c, (column, array)) in columns.iter_mut().zip(batch.columns()).enumerate() {
            let place = Place { name: &names[c], column: c, rows_before };
            match column {
                Cells::Numbers(values) => place.numbers(array, Arc::make_mut(values))?,
                Cells::Closures(closures) => {
                    let closures = Arc::make_mut(closures);
                    let kind = "published, printed or no_stretching";
                    for (row, text) in place.texts(array)?.enumerate() {
                        let closure = text.and_then(|text| closure_of_name("", text).ok());
                        closures.push(closure.ok_or_else(|| place.refuse(row, text, kind))?);
                    }
                }
            }
        }
        rows_before += batch.num_rows();
    }
    Ok(TableForm::of_columns(names, columns))
}

/// Where in the table a batch's column stands.
struct Place<'a> {
    name: &'a str,
    column: usize,
    rows_before: usize,
}

impl Place<'_> {
    fn refuse(&self, row: usize, value: impl Into<serde_json::Value>, kind: &str) -> Refusal {
        let row = self.rows_before + row;
        Refusal::value(
            format!("table.rows[{row}][{}]", self.column),
            value,
            format!("{kind} in row {}, column `{}`", row + 1, self.name),
        )
    }

    fn of_type(&self, array: &dyn Array, kind: &str) -> Refusal {
        let permitted = format!("a column of {kind}: `{}`", self.name);
        let field = format!("table.columns[{}]", self.column);
        Refusal::value(field, array.data_type().to_string(), permitted)
    }

    fn numbers(&self, array: &dyn Array, values: &mut Vec<f64>) -> Result<(), Refusal> {
        match array.data_type() {
            DataType::Float64 => self.take::<Float64Type>(array, values, |v| v),
            DataType::Float32 => self.take::<Float32Type>(array, values, f64::from),
            DataType::Int8 => self.take::<Int8Type>(array, values, f64::from),
            DataType::Int16 => self.take::<Int16Type>(array, values, f64::from),
            DataType::Int32 => self.take::<Int32Type>(array, values, f64::from),
            DataType::Int64 => self.take::<Int64Type>(array, values, |v| v as f64),
            DataType::UInt8 => self.take::<UInt8Type>(array, values, f64::from),
            DataType::UInt16 => self.take::<UInt16Type>(array, values, f64::from),
            DataType::UInt32 => self.take::<UInt32Type>(array, values, f64::from),
            DataType::UInt64 => self.take::<UInt64Type>(array, values, |v| v as f64),
            _ => Err(self.of_type(array, "numbers")),
        }
    }

    fn take<T: ArrowPrimitiveType>(
        &self,
        array: &dyn Array,
        values: &mut Vec<f64>,
        number: fn(T::Native) -> f64,
    ) -> Result<(), Refusal> {
        for (row, value) in array.as_primitive::<T>().iter().enumerate() {
            let kind = "a finite number";
            let value = value.map(number);
            let finite = value.filter(|v| v.is_finite());
            let shown = || value.map(|v| v.to_string());
            values.push(finite.ok_or_else(|| self.refuse(row, shown(), kind))?);
        }
        Ok(())
    }

    fn texts<'a>(
        &self,
        array: &'a dyn Array,
    ) -> Result<Box<dyn Iterator<Item = Option<&'a str>> + 'a>, Refusal> {
        match array.data_type() {
            DataType::Utf8 => Ok(Box::new(array.as_string::<i32>().iter())),
            DataType::LargeUtf8 => Ok(Box::new(array.as_string::<i64>().iter())),
            DataType::Utf8View => Ok(Box::new(array.as_string_view().iter())),
            _ => Err(self.of_type(array, "texts")),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use arrow_array::{ArrayRef, Float32Array, Float64Array, Int32Array, RecordBatch, StringArray};
    use parquet::arrow::ArrowWriter;
    use parquet::basic::Compression;
    use parquet::file::properties::WriterProperties;

    fn file(columns: Vec<(&str, ArrayRef)>) -> Bytes {
        let batch = RecordBatch::try_from_iter(columns).expect("a batch");
        let compression = WriterProperties::builder().set_compression(Compression::SNAPPY).build();
        let mut bytes = Vec::new();
        let writer = ArrowWriter::try_new(&mut bytes, batch.schema(), Some(compression));
        let mut writer = writer.expect("a writer");
        writer.write(&batch).expect("a written batch");
        writer.close().expect("a closed file");
        bytes.into()
    }

    #[test]
    fn numbers_of_any_width_and_closures_are_read() {
        let table = from_parquet(
            file(vec![
                ("b", Arc::new(Float64Array::from(vec![1e4, 2e4]))),
                ("d_m", Arc::new(Float32Array::from(vec![25.0, 26.5]))),
                ("n_cells", Arc::new(Int32Array::from(vec![20, 50]))),
                (CLOSURE, Arc::new(StringArray::from(vec!["published", "no_stretching"]))),
            ]),
            10,
        );
        let expected =
            "b,d_m,n_cells,upstream_closure\n1e4,25,20,published\n2e4,26.5,50,no_stretching";
        assert_eq!(table, TableForm::from_csv(expected.as_bytes()));
    }

    #[test]
    fn what_is_no_number_is_refused_with_its_place() {
        let refusal =
            |name, array| from_parquet(file(vec![(name, array)]), 10).expect_err("refused");
        let rows: [(&str, ArrayRef, &str); 5] = [
            ("b", Arc::new(Float64Array::from(vec![Some(1e4), None])), "table.rows[1][0]"),
            ("b", Arc::new(Float64Array::from(vec![f64::NAN])), "table.rows[0][0]"),
            ("b", Arc::new(StringArray::from(vec!["1e4"])), "table.columns[0]"),
            (CLOSURE, Arc::new(StringArray::from(vec!["publish"])), "table.rows[0][0]"),
            (CLOSURE, Arc::new(Float64Array::from(vec![1.0])), "table.columns[0]"),
        ];
        for (name, array, field) in rows {
            assert_eq!(refusal(name, array).field.as_deref(), Some(field));
        }
        let many: ArrayRef = Arc::new(Float64Array::from(vec![1e4; 11]));
        assert_eq!(refusal("b", many).field.as_deref(), Some("table.rows"));
        let nothing = from_parquet(Bytes::from_static(b"b\n1e4\n"), 10).expect_err("no Parquet");
        assert_eq!(nothing.field.as_deref(), Some("table"));
    }
}
