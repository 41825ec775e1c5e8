//! What an ensemble consists of: its files with their hashes, and one hash over all of them that depends on the
//! data alone.

use super::super::schema::Kind;
use crate::domain::document::Document;
use crate::domain::seal::Seal;
use crate::domain::status::Counts;
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// What the first member of a manifest says.
pub const FORMAT: &str = "melange ensemble";
/// Version of the folder's shape; one that is not known is not read.
pub const FORMAT_VERSION: u32 = 1;
/// Name of the manifest in its folder.
pub const MANIFEST: &str = "manifest.json";
/// Name of what was solved.
pub const SPEC: &str = "spec.json";

/// A manifest: `manifest.json`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct Manifest {
    /// `melange ensemble`.
    pub format: String,
    /// Version of the folder's shape.
    pub format_version: u32,
    /// BLAKE3 over what the files are, see `content_hash`.
    pub content_hash: String,
    /// Model version that the runs' ids are of; null if they are of an older one.
    pub model_version: Option<String>,
    /// The sweep.
    pub sweep: SweepEntry,
    /// What it is cited by; null if it is not sealed, and may have changed since.
    pub seal: Option<Seal>,
    /// Its files but for those that follow from them.
    pub files: Vec<FileEntry>,
}

/// A sweep in a manifest.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct SweepEntry {
    /// Its id where it was solved.
    pub id: String,
    /// Its name.
    pub name: String,
    /// Words to find it by.
    pub tags: Vec<String>,
    /// What people say of it, in Markdown.
    #[serde(default)]
    pub note: Option<String>,
    /// When it was submitted, RFC 3339 in UTC.
    pub created_at: String,
    /// Who submitted it.
    pub owner: Option<String>,
    /// Its runs by state.
    pub counts: Counts,
}

/// A file of an ensemble.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct FileEntry {
    /// Name in the folder.
    pub path: String,
    /// Bytes.
    pub bytes: u64,
    /// BLAKE3 of the bytes.
    pub blake3: String,
    /// SHA-256 of the bytes.
    pub sha256: String,
    /// Rows of a table.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rows: Option<u64>,
    /// Version of a table's schema.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub schema_version: Option<i64>,
}

impl FileEntry {
    /// The table it is, if it is one.
    pub fn table(&self) -> Option<Kind> {
        table_of(&self.path)
    }
}

/// The table of a file's name.
pub fn table_of(path: &str) -> Option<Kind> {
    Kind::from_name(path.strip_suffix(".parquet")?)
}

impl Manifest {
    /// A manifest from elsewhere, if it does not contradict itself; else what is wrong as a sentence.
    pub fn checked(text: &str) -> Result<Self, String> {
        let unreadable = |e: serde_json::Error| format!("{MANIFEST} cannot be read: {e}");
        let told: serde_json::Value = serde_json::from_str(text).map_err(unreadable)?;
        if told["format"] != FORMAT {
            return Err(format!("{MANIFEST} is not of a {FORMAT}"));
        }
        if told["format_version"] != FORMAT_VERSION {
            return Err(format!(
                "{MANIFEST} has format version {}, and this version of melange reads {FORMAT_VERSION}",
                told["format_version"]
            ));
        }
        let manifest: Self = serde_json::from_value(told).map_err(unreadable)?;
        manifest.check().map_err(|why| format!("{MANIFEST} contradicts itself: {why}"))?;
        Ok(manifest)
    }

    fn check(&self) -> Result<(), String> {
        let Self { files, sweep, seal, .. } = self;
        for (i, file) in files.iter().enumerate() {
            if files[..i].iter().any(|f| f.path == file.path) {
                return Err(format!("{} is there twice", file.path));
            }
            match file.table() {
                None if file.path == SPEC => {}
                Some(_) if file.rows.is_some_and(|n| n > 0) && file.schema_version.is_some() => {}
                _ => return Err(format!("{:?} is no file of an ensemble", file.path)),
            }
        }
        if !files.iter().any(|file| file.path == SPEC) {
            return Err(format!("it has no {SPEC}"));
        }
        if content_hash(self.model_version.as_deref(), files) != self.content_hash {
            return Err("its content hash is not that of its files".into());
        }
        let is_line =
            |text: &str| text.chars().count() <= 300 && !text.chars().any(char::is_control);
        let texts = [Some(&sweep.name), sweep.owner.as_ref(), self.model_version.as_ref()];
        if !texts.into_iter().flatten().all(|text| is_line(text)) {
            return Err("a name is no line of up to 300 characters".into());
        }
        humantime::parse_rfc3339(&sweep.created_at).map_err(|e| format!("created_at: {e}"))?;
        if sweep.counts.check().is_none() {
            return Err("the counts of its runs do not add up".into());
        }
        let Some(seal) = seal else { return Ok(()) };
        let Counts { queued, running, cancelled, .. } = sweep.counts;
        if (queued, running, cancelled) != (0, 0, 0) {
            return Err("it is sealed and has runs without a result".into());
        }
        if seal.content_hash != self.content_hash {
            return Err("its seal is of other data".into());
        }
        let form = seal.form.clone().checked().map_err(|refusal| refusal.detail)?;
        if form != seal.form || !is_line(&seal.sealed_by) || !is_line(&seal.melange_version) {
            return Err("its seal is not written as one is".into());
        }
        humantime::parse_rfc3339(&seal.sealed_at).map_err(|e| format!("sealed_at: {e}"))?;
        Ok(())
    }
}

/// Name of a table's file.
pub fn table_path(kind: Kind) -> String {
    format!("{}.parquet", kind.name())
}

/// BLAKE3 of the lines `melange ensemble 1`, `model VERSION` (or `model -`) and, for each file in the order of
/// the paths' bytes, `BLAKE3  BYTES  PATH`; each line ends with a line feed. Name, authors and time have no part
/// in it.
pub fn content_hash(model_version: Option<&str>, files: &[FileEntry]) -> String {
    let mut files: Vec<&FileEntry> = files.iter().collect();
    files.sort_by(|a, b| a.path.cmp(&b.path));
    let mut hasher = blake3::Hasher::new();
    hasher.update(format!("{FORMAT} {FORMAT_VERSION}\n").as_bytes());
    hasher.update(format!("model {}\n", model_version.unwrap_or("-")).as_bytes());
    for file in files {
        hasher.update(format!("{}  {}  {}\n", file.blake3, file.bytes, file.path).as_bytes());
    }
    hasher.finalize().to_hex().to_string()
}

/// What was solved: the document without what leaves no trace in the runs.
pub fn spec(document: &str) -> String {
    let Ok(mut parsed) = Document::parse(document) else {
        // Of a version that wrote documents otherwise.
        return document.to_owned();
    };
    (parsed.name, parsed.priority, parsed.force) = (None, None, None);
    parsed.tags = Vec::new();
    serde_json::to_string_pretty(&parsed).expect("a document is plain data") + "\n"
}

#[cfg(test)]
mod tests {
    use super::*;

    fn file(path: &str, bytes: u64) -> FileEntry {
        let blake3 = blake3::hash(path.as_bytes()).to_hex().to_string();
        let sha256 = String::new();
        FileEntry { path: path.into(), bytes, blake3, sha256, rows: None, schema_version: None }
    }

    #[test]
    fn the_hash_depends_on_the_files_and_not_on_their_order() {
        let (a, b) = (file("runs.parquet", 3), file("spec.json", 4));
        let hash = content_hash(Some("m"), &[a.clone(), b.clone()]);
        assert_eq!(hash, content_hash(Some("m"), &[b.clone(), a.clone()]));
        for other in [
            content_hash(None, &[a.clone(), b.clone()]),
            content_hash(Some("m"), std::slice::from_ref(&a)),
            content_hash(Some("m"), &[a.clone(), file("spec.json", 5)]),
            content_hash(Some("m"), &[a, file("spec.jsom", 4)]),
        ] {
            assert_ne!(hash, other);
        }
        // Whoever changes this changes every citation.
        let empty = blake3::hash(b"melange ensemble 1\nmodel m\n").to_hex().to_string();
        assert_eq!(content_hash(Some("m"), &[]), empty);
    }

    #[test]
    fn a_spec_has_what_the_runs_depend_on() {
        let told = spec(
            r#"{"name": "n", "tags": ["t"], "priority": 3, "force": true, "regime": "steady"}"#,
        );
        assert_eq!(told, "{\n  \"regime\": \"steady\"\n}\n");
    }
}
