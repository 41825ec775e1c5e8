//! Bulk tables: Parquet with units, CSV, the same numbers in both and in the lists.

use crate::{melt_sweep, number};
use arrow_array::cast::AsArray;
use arrow_array::types::Float64Type;
use arrow_array::{Array, RecordBatch};
use arrow_schema::SchemaRef;
use bytes::Bytes;
use melange_tests::{Server, folder};
use parquet::arrow::arrow_reader::ParquetRecordBatchReaderBuilder;

pub(crate) fn read(bytes: Vec<u8>) -> Vec<RecordBatch> {
    ParquetRecordBatchReaderBuilder::try_new(Bytes::from(bytes))
        .and_then(|builder| builder.build())
        .expect("a Parquet file")
        .collect::<Result<_, _>>()
        .expect("readable to its end")
}

/// Schema of a Parquet file.
pub(crate) fn schema(bytes: Vec<u8>) -> SchemaRef {
    let builder = ParquetRecordBatchReaderBuilder::try_new(Bytes::from(bytes));
    builder.expect("a Parquet file").schema().clone()
}

fn column(batches: &[RecordBatch], name: &str) -> Vec<f64> {
    batches
        .iter()
        .flat_map(|b| {
            let column = b.column_by_name(name).expect("the column").as_primitive::<Float64Type>();
            column.values().to_vec()
        })
        .collect()
}

#[test]
fn parquet_and_csv_carry_the_listed_numbers() {
    let folder = folder();
    let server = Server::start("serve", folder.path(), &[]);
    let id = server.submit(&melt_sweep(11));
    server.wait(&id);
    let list = server.json(&format!("/api/v1/sweeps/{id}/runs"));
    let listed: Vec<f64> = list["items"]
        .as_array()
        .expect("items")
        .iter()
        .map(|r| number(&r["force_n_per_m"]))
        .collect();

    let answer = server.get(&format!("/api/v1/sweeps/{id}/runs.parquet"));
    assert_eq!(answer.content_type, "application/vnd.apache.parquet");
    let runs = read(answer.body);
    assert_eq!(column(&runs, "force_n_per_m"), listed);
    let schema = runs[0].schema();
    for (name, unit) in [
        ("force_n_per_m", "N m-1"),
        ("melt_rate_m_per_day", "m d-1"),
        ("length_m", "m"),
        ("mu_s", "1"),
    ] {
        let field = schema.field_with_name(name).expect("the column");
        assert_eq!(field.metadata().get("unit").map(String::as_str), Some(unit), "{name}");
        assert!(field.metadata().contains_key("meaning"), "{name}");
    }

    let answer = server.get(&format!("/api/v1/sweeps/{id}/runs.csv"));
    let text = String::from_utf8(answer.body).expect("UTF-8");
    let mut lines = text.lines();
    let header: Vec<&str> = lines.next().expect("a header").split(',').collect();
    let force = header.iter().position(|h| *h == "force_n_per_m").expect("the column");
    // The detail, which comes before the force, is quoted and holds one comma.
    let forces: Vec<f64> = lines
        .map(|line| {
            let after_detail =
                line.splitn(3, '"').last().expect("the rest").trim_start_matches(',');
            after_detail.split(',').nth(force - 4).expect("the force").parse().expect("a number")
        })
        .collect();
    assert_eq!(forces, listed);

    let profiles = read(server.get(&format!("/api/v1/sweeps/{id}/profiles.parquet")).body);
    let rows: usize = profiles.iter().map(RecordBatch::num_rows).sum();
    assert_eq!(rows, 11);
    let first = &profiles[0];
    assert!(first.column_by_name("time_a").expect("times").is_null(0));
    for (name, length) in [("node_x_m", 51), ("velocity_m_per_a", 51), ("thickness_m", 50)] {
        let lists = first.column_by_name(name).expect("the column").as_list::<i32>();
        assert_eq!(lists.value(0).len(), length, "{name}");
    }
    let series = read(server.get(&format!("/api/v1/sweeps/{id}/series.parquet")).body);
    assert_eq!(series.iter().map(RecordBatch::num_rows).sum::<usize>(), 0);
}
