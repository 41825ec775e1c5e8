//! Files put behind each other without decoding them: their groups of rows are copied as they are.

use super::catalogue::{Layout, Piece, Place};
use super::schema::{Kind, SCHEMA_VERSION};
use super::{ArchiveError, files};
use parquet::column::writer::ColumnCloseResult;
use parquet::errors::ParquetError;
use parquet::file::metadata::{PageIndexPolicy, ParquetMetaData, ParquetMetaDataReader};
use parquet::file::properties::WriterProperties;
use parquet::file::writer::SerializedFileWriter;
use std::fs::File;
use std::path::Path;
use std::sync::Arc;

/// Most files put behind each other: many small groups of rows make a table slow to read.
const MOST_FILES: usize = 500;

/// The files that are the whole table one after the other, if that is what it stands in.
pub fn whole_files(layout: &Layout) -> Option<Vec<&Place>> {
    let mut places = Vec::with_capacity(layout.groups.len());
    for group in &layout.groups {
        let [Piece { place, wanted: None }] = group.as_slice() else { return None };
        let is_whole = place.first_row == 0 && place.row_count == place.file.row_count;
        if !is_whole || place.file.schema_version != SCHEMA_VERSION {
            return None;
        }
        places.push(place);
    }
    Some(places).filter(|places| (1..=MOST_FILES).contains(&places.len()))
}

/// Puts whole files behind each other.
pub fn splice(
    target: &mut File,
    archive: &Path,
    places: &[&Place],
    kind: Kind,
) -> Result<(), ArchiveError> {
    let damaged = |source: ParquetError| {
        ArchiveError::of_parquet(format!("a copy of all {}", kind.name()), "written", source)
    };
    let mut sources = Vec::with_capacity(places.len());
    for place in places {
        let file = files::open(archive, &place.file)?;
        let metadata = metadata(&file)
            .map_err(|source| ArchiveError::Parquet { path: place.file.path.clone(), source })?;
        sources.push((file, metadata));
    }
    let Some((_, first)) = sources.first() else { return Ok(()) };
    let described = first.file_metadata();
    let properties = WriterProperties::builder()
        .set_key_value_metadata(described.key_value_metadata().cloned())
        .build();
    let schema = described.schema_descr().root_schema_ptr();
    let mut writer =
        SerializedFileWriter::new(target, schema, Arc::new(properties)).map_err(damaged)?;
    for (file, metadata) in &sources {
        append(&mut writer, file, metadata).map_err(damaged)?;
    }
    writer.close().map(drop).map_err(damaged)
}

fn metadata(file: &File) -> Result<ParquetMetaData, ParquetError> {
    ParquetMetaDataReader::new()
        .with_page_index_policy(PageIndexPolicy::Optional)
        .parse_and_finish(file)
}

fn append(
    writer: &mut SerializedFileWriter<&mut File>,
    file: &File,
    metadata: &ParquetMetaData,
) -> Result<(), ParquetError> {
    let pages = metadata.page_index();
    for (g, group) in metadata.row_groups().iter().enumerate() {
        let mut into = writer.next_row_group()?;
        for (c, column) in group.columns().iter().enumerate() {
            let close = ColumnCloseResult {
                bytes_written: column.compressed_size() as u64,
                rows_written: group.num_rows() as u64,
                metadata: column.clone(),
                bloom_filter: None,
                column_index: pages.and_then(|p| p.column_index(g, c)).cloned(),
                offset_index: pages.and_then(|p| p.offset_index(g, c)).cloned(),
            };
            into.append_column(file, close)?;
        }
        into.close()?;
    }
    Ok(())
}
