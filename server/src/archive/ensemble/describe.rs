//! What describes an ensemble to whoever has no melange: manifest, column dictionary, how to read it.

use super::super::schema::Kind;
use super::manifest::Manifest;
use crate::domain::citation::{CitationFormat, citation};

/// A column of a table, for whoever reads it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Column {
    /// Name.
    pub name: String,
    /// Type in Parquet.
    pub data_type: String,
    /// Unit; `1` for what has none.
    pub unit: String,
    /// Meaning.
    pub meaning: String,
}

/// The columns of a table.
pub fn columns(kind: Kind) -> Vec<Column> {
    let schema = kind.schema();
    let column = |field: &std::sync::Arc<arrow_schema::Field>| {
        let told = |key: &str| field.metadata().get(key).cloned().unwrap_or_default();
        let data_type = match field.data_type() {
            arrow_schema::DataType::Utf8 => "text".to_owned(),
            arrow_schema::DataType::List(item) => format!("list of {}", item.data_type()),
            other => other.to_string(),
        };
        let (unit, meaning) = (told("unit"), told("meaning"));
        Column { name: field.name().clone(), data_type, unit, meaning }
    };
    schema.fields().iter().map(column).collect()
}

/// What a table holds, in a sentence.
pub fn meaning(kind: Kind) -> &'static str {
    match kind {
        Kind::Runs => "one row per run: parameters, status and numbers of the result",
        Kind::Profiles => "one row per run and stored time: arrays on the grid",
        Kind::Series => "one row per transient and output time",
        Kind::Branches => "one row per point, fold, root, crossing and end of a branch",
        Kind::Sensitivities => "one row per steady state and quantity: its derivatives",
        Kind::Calibrations => {
            "one row per estimate, observation, start and sample of a calibration"
        }
        Kind::Roots => "one row per discrete steady state of a run",
    }
}

/// `README.md` of an exported folder.
pub fn readme(manifest: &Manifest) -> String {
    let title = manifest.seal.as_ref().map_or(&manifest.sweep.name, |seal| &seal.form.title);
    let mut text = format!("# {title}\n\n");
    if let Some(description) = manifest.seal.as_ref().and_then(|s| s.form.description.as_ref()) {
        text += &format!("{description}\n\n");
    }
    text += "An ensemble of the quasi-one-dimensional ice mélange model of Amundson et al. (2025), \
             https://doi.org/10.5194/tc-19-19-2025, computed with melange.\n\n";
    match &manifest.seal {
        Some(seal) => {
            text += &format!(
                "Sealed on {} with the content hash (BLAKE3)\n`{}`; licence {}. How to cite it: `CITATION.bib`.\n\n",
                seal.day(),
                seal.content_hash,
                seal.form.licence
            );
            text += &citation(seal, CitationFormat::Text);
            text += "\n";
        }
        None => {
            text += "**Not sealed**: this is the sweep as it was when it was exported, which may have changed \
                     since and cannot be cited by its hash.\n\n";
        }
    }
    let counts = &manifest.sweep.counts;
    text += &format!("{} runs", counts.total);
    if counts.failed > 0 {
        text += &format!(
            ", {} of which failed: the solver gave up, and the row says so in `status` and `detail`",
            counts.failed
        );
    }
    text += ".\n\n## Reading it\n\n```python\nimport pandas as pd\nruns = pd.read_parquet(\"runs.parquet\")\n\
             runs.plot.scatter(\"melt_rate_m_per_day\", \"force_n_per_m\")\n```\n\n\
             `ensemble.nc` (left out of sweeps that are too large for one) has runs, profiles and series as one \
             dataset:\n`xarray.open_dataset(\"ensemble.nc\")`.\n\
             Tables are joined by `run_id`. `spec.json` says what was solved, `manifest.json` has hash and size of \
             each file,\n`ro-crate-metadata.json` describes all of it for machines (RO-Crate). \
             `sha256sum -c checksums.sha256` compares every file.\n\
             `melange import` takes the archive that this folder came in.\n";
    for entry in &manifest.files {
        let Some(kind) = entry.table() else { continue };
        let rows = entry.rows.unwrap_or_default();
        text += &format!("\n## {} ({rows} rows)\n\n{}.\n\n", entry.path, capital(meaning(kind)));
        text += "| column | type | unit | meaning |\n|---|---|---|---|\n";
        for Column { name, data_type, unit, meaning } in columns(kind) {
            let meaning = meaning.replace('|', "\\|");
            text += &format!("| `{name}` | {data_type} | {unit} | {meaning} |\n");
        }
    }
    text
}

fn capital(text: &str) -> String {
    let mut characters = text.chars();
    let first = characters.next().map(|c| c.to_uppercase().to_string());
    first.unwrap_or_default() + characters.as_str()
}
