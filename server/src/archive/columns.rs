//! The dictionary of all tables' columns, generated from their schema. `docs/columns.md` is its text.

use super::schema::{Kind, SCHEMA_VERSION};
use arrow_schema::{DataType, Field};
use serde::Serialize;
use utoipa::ToSchema;

/// A table of a sweep.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, ToSchema)]
pub struct TableEntry {
    name: &'static str,
    meaning: &'static str,
    columns: Vec<ColumnEntry>,
}

/// A column of a table.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, ToSchema)]
pub struct ColumnEntry {
    name: String,
    /// Type as Arrow has it: `utf8`, `int64`, `float64`, `bool`, `list<float64>`, `list<int64>`.
    #[serde(rename = "type")]
    kind: String,
    /// Unit; `1` where there is none.
    unit: String,
    meaning: String,
    /// Whether it can be null.
    nullable: bool,
}

/// All tables.
pub fn tables() -> Vec<TableEntry> {
    let table = |kind: Kind| TableEntry {
        name: kind.name(),
        meaning: kind.meaning(),
        columns: kind.schema().fields().iter().map(|field| column(field)).collect(),
    };
    Kind::ALL.into_iter().map(table).collect()
}

/// All tables as Markdown.
pub fn markdown() -> String {
    let mut text = format!(
        "# Columns\n\nThe tables of a sweep, schema version {SCHEMA_VERSION}; written by `melange columns`, \
         from what the files are written by.\nUnits as in the files: `a` is a year of 365.25 days, `d` a day, \
         `1` no unit. Every column has its unit and meaning in its metadata.\n"
    );
    for table in tables() {
        text += &format!("\n## {}\n\n{}.\n\n", table.name, capital(table.meaning));
        text += "| column | type | unit | meaning | can be null |\n|---|---|---|---|---|\n";
        for ColumnEntry { name, kind, unit, meaning, nullable } in table.columns {
            let (meaning, nullable) = (cell(&meaning), if nullable { "yes" } else { "no" });
            text += &format!("| `{name}` | {kind} | {} | {meaning} | {nullable} |\n", cell(&unit));
        }
    }
    text
}

fn column(field: &Field) -> ColumnEntry {
    let of = |key: &str| field.metadata().get(key).cloned().unwrap_or_default();
    ColumnEntry {
        name: field.name().clone(),
        kind: name_of(field.data_type()),
        unit: of("unit"),
        meaning: of("meaning"),
        nullable: field.is_nullable(),
    }
}

fn name_of(kind: &DataType) -> String {
    match kind {
        DataType::Utf8 => "utf8".into(),
        DataType::Int64 => "int64".into(),
        DataType::UInt64 => "uint64".into(),
        DataType::Float64 => "float64".into(),
        DataType::Boolean => "bool".into(),
        DataType::List(item) => format!("list<{}>", name_of(item.data_type())),
        other => unreachable!("no table has a column of {other}"),
    }
}

fn capital(sentence: &str) -> String {
    let mut letters = sentence.chars();
    letters.next().map_or_else(String::new, |first| first.to_uppercase().chain(letters).collect())
}

/// Text in a table's cell; a bar would end it, and `<` begin markup.
fn cell(text: &str) -> String {
    text.replace('|', "\\|").replace('<', "&lt;")
}
