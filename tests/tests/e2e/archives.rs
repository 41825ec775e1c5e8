//! Exported archives taken apart and put together again, as they are or as somebody with ill intent would.

use arrow_array::cast::AsArray;
use arrow_array::{ArrayRef, RecordBatch};
use bytes::Bytes;
use parquet::arrow::ArrowWriter;
use parquet::arrow::arrow_reader::ParquetRecordBatchReaderBuilder;
use parquet::basic::{Compression, ZstdLevel};
use parquet::file::properties::WriterProperties;
use serde_json::Value;
use sha2::{Digest, Sha256};
use std::io::Read;
use std::path::Path;
use std::sync::Arc;
use tar::{EntryType, Header};

/// An archive's files, in their order.
#[derive(Debug, Clone, Default)]
pub struct Archive(pub Vec<(String, Vec<u8>)>);

impl Archive {
    /// Takes an archive apart.
    pub fn read(path: &Path) -> Self {
        let file = std::fs::File::open(path).expect("an archive");
        let mut tar = tar::Archive::new(zstd::Decoder::new(file).expect("zstd"));
        let mut files = Vec::new();
        for entry in tar.entries().expect("a tar") {
            let mut entry = entry.expect("an entry");
            let path = entry.path().expect("a path").display().to_string();
            let mut bytes = Vec::new();
            entry.read_to_end(&mut bytes).expect("its bytes");
            files.push((path, bytes));
        }
        Self(files)
    }

    /// Its one folder.
    pub fn folder(&self) -> String {
        self.0[0].0.split('/').next().expect("a folder").to_owned()
    }

    /// The bytes of a file of its one folder.
    pub fn file(&mut self, name: &str) -> &mut Vec<u8> {
        let ending = format!("/{name}");
        let file = self.0.iter_mut().find(|(path, _)| path.ends_with(&ending));
        &mut file.unwrap_or_else(|| panic!("no {name}")).1
    }

    /// Changes its manifest.
    pub fn change_manifest(&mut self, change: impl FnOnce(&mut Value)) {
        let text = self.file("manifest.json");
        let mut manifest: Value = serde_json::from_slice(text).expect("JSON");
        change(&mut manifest);
        *text = manifest.to_string().into_bytes();
    }

    /// Makes the manifest fit the files again, as a forger would.
    pub fn forge_hashes(&mut self) {
        let files = self.clone();
        self.change_manifest(|manifest| {
            let mut lines = Vec::new();
            for file in manifest["files"].as_array_mut().expect("files") {
                let name = file["path"].as_str().expect("a path").to_owned();
                let ending = format!("/{name}");
                let bytes = files.0.iter().find(|(p, _)| p.ends_with(&ending)).expect("a file");
                let blake3 = blake3::hash(&bytes.1).to_hex().to_string();
                file["bytes"] = bytes.1.len().into();
                file["blake3"] = blake3.as_str().into();
                let sha256 = Sha256::digest(&bytes.1);
                let digits: String = sha256.iter().map(|b| format!("{b:02x}")).collect();
                file["sha256"] = digits.into();
                if name.ends_with(".parquet") {
                    file["rows"] = rows_of(&bytes.1).into();
                }
                lines.push((name.clone(), format!("{blake3}  {}  {name}\n", bytes.1.len())));
            }
            lines.sort();
            let model = manifest["model_version"].as_str().unwrap_or("-");
            let lines: String = lines.into_iter().map(|(_, line)| line).collect();
            let text = format!("melange ensemble 1\nmodel {model}\n{lines}");
            let hash = blake3::hash(text.as_bytes()).to_hex().to_string();
            manifest["content_hash"] = hash.as_str().into();
            if !manifest["seal"].is_null() {
                manifest["seal"]["content_hash"] = hash.into();
            }
        });
    }

    /// Makes the manifest fit the files again, with the rows that it told before.
    pub fn forge_hashes_and_rows(&mut self, before: &Self) {
        let mut before = before.clone();
        let told: Value = serde_json::from_slice(before.file("manifest.json")).expect("JSON");
        self.forge_hashes();
        self.change_manifest(|manifest| {
            let files = manifest["files"].as_array_mut().expect("files");
            for (file, told) in files.iter_mut().zip(told["files"].as_array().expect("files")) {
                if !told["rows"].is_null() {
                    file["rows"] = told["rows"].clone();
                }
            }
        });
    }

    /// Changes a table's rows and makes the manifest fit.
    pub fn change_table(&mut self, name: &str, change: impl FnOnce(RecordBatch) -> RecordBatch) {
        let bytes = self.file(name);
        let builder = ParquetRecordBatchReaderBuilder::try_new(Bytes::from(bytes.clone()));
        let builder = builder.expect("Parquet");
        let batches: Vec<RecordBatch> = builder
            .with_batch_size(1 << 20)
            .build()
            .expect("a reader")
            .map(|b| b.expect("a batch"))
            .collect();
        let [batch] = batches.try_into().expect("one batch");
        let batch = change(batch);
        let compression = Compression::ZSTD(ZstdLevel::default());
        let properties = WriterProperties::builder().set_compression(compression).build();
        let mut writer =
            ArrowWriter::try_new(Vec::new(), batch.schema(), Some(properties)).expect("a writer");
        writer.write(&batch).expect("a written batch");
        *bytes = writer.into_inner().expect("a closed file");
        self.forge_hashes();
    }

    /// The archive as a plain tar.
    pub fn tar(&self) -> Vec<u8> {
        let mut tar = tar::Builder::new(Vec::new());
        for (path, bytes) in &self.0 {
            append(&mut tar, path, EntryType::Regular, bytes);
        }
        tar.into_inner().expect("a tar")
    }

    /// The archive, compressed.
    pub fn packed(&self) -> Vec<u8> {
        pack(&self.tar())
    }
}

/// Compresses a tar.
pub fn pack(tar: &[u8]) -> Vec<u8> {
    zstd::encode_all(tar, 3).expect("it compresses")
}

/// Adds an entry whatever its name and type: the builder's own ways refuse what this is for.
pub fn append(tar: &mut tar::Builder<Vec<u8>>, path: &str, entry_type: EntryType, bytes: &[u8]) {
    let mut header = Header::new_ustar();
    header.as_mut_bytes()[..path.len()].copy_from_slice(path.as_bytes());
    header.set_entry_type(entry_type);
    header.set_mode(0o644);
    if !bytes.is_empty() && entry_type != EntryType::Regular {
        header.set_link_name(String::from_utf8_lossy(bytes).as_ref()).expect("a link");
        header.set_size(0);
        header.set_cksum();
        tar.append(&header, &[][..]).expect("an entry");
        return;
    }
    header.set_size(bytes.len() as u64);
    header.set_cksum();
    tar.append(&header, bytes).expect("an entry");
}

/// A batch with another column in place of one.
pub fn with_column(batch: &RecordBatch, name: &str, column: ArrayRef) -> RecordBatch {
    let at = batch.schema().index_of(name).expect("a column");
    let mut columns = batch.columns().to_vec();
    let mut fields: Vec<_> = batch.schema().fields().iter().cloned().collect();
    let field = fields[at].as_ref().clone().with_data_type(column.data_type().clone());
    (columns[at], fields[at]) = (column, Arc::new(field));
    let schema = arrow_schema::Schema::new_with_metadata(fields, batch.schema().metadata().clone());
    RecordBatch::try_new(Arc::new(schema), columns).expect("a batch")
}

/// A column of texts, of which one is changed.
pub fn with_text(batch: &RecordBatch, name: &str, row: usize, text: &str) -> RecordBatch {
    let column = batch.column_by_name(name).expect("a column").as_string::<i32>();
    let mut texts: Vec<Option<String>> = column.iter().map(|t| t.map(str::to_owned)).collect();
    texts[row] = Some(text.to_owned());
    with_column(batch, name, Arc::new(arrow_array::StringArray::from(texts)))
}

/// A column of numbers, of which one is changed.
pub fn with_number(batch: &RecordBatch, name: &str, row: usize, number: f64) -> RecordBatch {
    let column = batch.column_by_name(name).expect("a column");
    let mut numbers: Vec<Option<f64>> =
        column.as_primitive::<arrow_array::types::Float64Type>().iter().collect();
    numbers[row] = Some(number);
    with_column(batch, name, Arc::new(arrow_array::Float64Array::from(numbers)))
}

fn rows_of(bytes: &[u8]) -> i64 {
    let builder = ParquetRecordBatchReaderBuilder::try_new(Bytes::from(bytes.to_vec()));
    builder.map_or(0, |b| b.metadata().file_metadata().num_rows())
}
