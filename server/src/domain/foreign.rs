//! Tables of somebody's earlier results: read by a column map that leaves nothing to guess, and compared with runs
//! of this model. Pure.

use super::document::{Document, Regime};
use super::outcome::SCALARS;
use super::parameters::PARAMETERS;
use super::refusal::Refusal;
use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, BTreeSet};
use utoipa::ToSchema;

/// How a table's columns become parameters and results: TOML or JSON.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct ColumnMap {
    /// Who computed it, when, and by which code.
    pub source: String,
    /// The closure at the terminus that its states were computed with.
    #[serde(default = "published")]
    pub upstream_closure: String,
    /// By name of a parameter or of a number of a result: where it stands, or what it is in every row.
    pub columns: BTreeMap<String, Entry>,
}

/// Where a number comes from.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct Entry {
    /// The column.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub column: Option<String>,
    /// What the column's numbers are multiplied with; 1 if not given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub scale: Option<f64>,
    /// The number in every row, of a parameter that does not vary.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub value: Option<f64>,
}

fn published() -> String {
    "published".into()
}

/// A row: parameters, all of them, and the results that it has.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct ForeignRow {
    /// Every parameter by its name.
    pub parameters: BTreeMap<String, f64>,
    /// Results by their names; what is not there is missing.
    pub results: BTreeMap<String, f64>,
}

/// A table that was read.
#[derive(Debug, Clone, PartialEq)]
pub struct ForeignTable {
    /// Its map.
    pub map: ColumnMap,
    /// Its rows.
    pub rows: Vec<ForeignRow>,
    /// Columns that the map does not name.
    pub ignored: Vec<String>,
}

/// Longest note on a source, and longest name of a table.
const LINE: usize = 500;
/// Most rows.
const MOST_ROWS: usize = 200_000;
/// Relative difference of parameters that are the same: what writing them as text costs at most.
const SAME: f64 = 1e-9;

/// A line of text that is not empty.
pub fn line(field: &str, text: &str) -> Result<String, Refusal> {
    let text = text.trim();
    if (1..=LINE).contains(&text.chars().count()) && !text.chars().any(char::is_control) {
        return Ok(text.to_owned());
    }
    let permitted = format!("one line of 1 to {LINE} characters");
    Err(Refusal::value(field, text.chars().take(LINE).collect::<String>(), permitted))
}

impl ColumnMap {
    /// Reads a map: JSON if its first character is `{`, else TOML.
    pub fn parse(text: &str) -> Result<Self, Refusal> {
        let refusal = |e: &dyn std::error::Error| Refusal {
            field: Some("map".into()),
            ..Refusal::sentence(format!("the column map cannot be read: {e}"))
        };
        let map: Self = if text.trim_start().starts_with('{') {
            serde_json::from_str(text).map_err(|e| refusal(&e))?
        } else {
            toml::from_str(text).map_err(|e| refusal(&e))?
        };
        map.checked()
    }

    fn checked(mut self) -> Result<Self, Refusal> {
        self.source = line("source", &self.source)?;
        super::run::closure_of_name("upstream_closure", &self.upstream_closure)?;
        let (mut parameters, mut results) = (0, 0);
        for (name, entry) in &self.columns {
            let field = format!("columns.{name}");
            let is_result = SCALARS.iter().any(|s| s.name == name);
            let is_parameter = PARAMETERS.iter().any(|p| p.name == name);
            match entry {
                _ if !is_parameter && !is_result => {
                    let permitted = "the name of a parameter or of a number of a result, see /api/v1/dictionary";
                    return Err(Refusal::value(field, name.as_str(), permitted));
                }
                Entry { column: Some(_), scale, value: None } => {
                    if scale.is_some_and(|s| !s.is_finite() || s == 0.0) {
                        let scale = scale.unwrap_or_default();
                        return Err(Refusal::number(field, scale, "a scale that is not 0"));
                    }
                }
                Entry { column: None, scale: None, value: Some(value) } if is_parameter => {
                    if !value.is_finite() {
                        return Err(Refusal::number(field, *value, "a finite number"));
                    }
                }
                _ => {
                    let why = "an entry is {column, scale} or, for a parameter, {value}";
                    return Err(Refusal::out_of_place(&field, why));
                }
            }
            parameters += usize::from(is_parameter);
            results += usize::from(is_result);
        }
        if parameters == 0 || results == 0 {
            let why = "a map names at least one parameter and one number of a result";
            return Err(Refusal::missing("columns", why));
        }
        Ok(self)
    }

    /// Parameters that the map does not name, with the defaults that they have then.
    pub fn assumed(&self) -> BTreeMap<String, f64> {
        let unnamed = PARAMETERS.iter().filter(|p| !self.columns.contains_key(p.name));
        unnamed.map(|p| (p.name.to_owned(), p.default)).collect()
    }

    /// Reads a table of comma separated values with a header.
    pub fn read(self, csv: &[u8]) -> Result<ForeignTable, Refusal> {
        let unreadable = |e: csv::Error| Refusal {
            field: Some("table".into()),
            ..Refusal::sentence(format!("the table is not readable as CSV: {e}"))
        };
        let mut reader = csv::ReaderBuilder::new().trim(csv::Trim::All).from_reader(csv);
        let header = reader.headers().map_err(unreadable)?.clone();
        let names: Vec<&str> = header.iter().map(|n| n.trim_start_matches('\u{feff}')).collect();
        let mut places = Vec::new();
        for (name, entry) in &self.columns {
            let Some(column) = &entry.column else { continue };
            let found: Vec<usize> =
                (0..names.len()).filter(|i| names[*i] == column.as_str()).collect();
            let [at] = found[..] else {
                let permitted =
                    format!("a column that the table has once; it has {}", names.join(", "));
                return Err(Refusal::value(
                    format!("columns.{name}.column"),
                    column.as_str(),
                    permitted,
                ));
            };
            places.push((name.clone(), at, entry.scale.unwrap_or(1.0)));
        }
        let mut rows = Vec::new();
        for (i, record) in reader.records().enumerate() {
            let record = record.map_err(unreadable)?;
            if i >= MOST_ROWS {
                return Err(Refusal::value(
                    "table.rows",
                    i + 1,
                    format!("at most {MOST_ROWS} rows"),
                ));
            }
            rows.push(self.row(i, &record, &places)?);
        }
        if rows.is_empty() {
            return Err(Refusal::missing("table.rows", "a table has at least one row"));
        }
        let named: BTreeSet<usize> = places.iter().map(|(_, at, _)| *at).collect();
        let ignored = (0..names.len()).filter(|i| !named.contains(i)).map(|i| names[i].to_owned());
        Ok(ForeignTable { ignored: ignored.collect(), rows, map: self })
    }

    fn row(
        &self,
        row: usize,
        record: &csv::StringRecord,
        places: &[(String, usize, f64)],
    ) -> Result<ForeignRow, Refusal> {
        let mut parameters = self.assumed();
        for (name, entry) in &self.columns {
            if let Some(value) = entry.value {
                parameters.insert(name.clone(), value);
            }
        }
        let mut results = BTreeMap::new();
        for (name, at, scale) in places {
            let cell = record.get(*at).unwrap_or_default();
            let is_parameter = parameter(name).is_some();
            if cell.is_empty() && !is_parameter {
                continue;
            }
            let number = cell.parse::<f64>().ok().map(|n| n * scale).filter(|n| n.is_finite());
            let number = number.ok_or_else(|| {
                let permitted = format!("a finite number for {name} in row {}", row + 1);
                Refusal::value(format!("table.rows[{row}][{at}]"), cell, permitted)
            })?;
            let place = if is_parameter { &mut parameters } else { &mut results };
            place.insert(name.clone(), number);
        }
        Ok(ForeignRow { parameters, results })
    }
}

fn parameter(name: &str) -> Option<&'static super::parameters::ParameterInfo> {
    PARAMETERS.iter().find(|p| p.name == name)
}

impl ForeignRow {
    /// Whether all parameters are those of a run but for how they were written.
    pub fn is_at(&self, parameters: &BTreeMap<String, f64>) -> bool {
        self.parameters
            .iter()
            .all(|(name, a)| parameters.get(name).is_some_and(|b| is_same(*a, *b)))
    }
}

fn is_same(a: f64, b: f64) -> bool {
    (a - b).abs() <= SAME * a.abs().max(b.abs())
}

/// Rows by one of their parameters, to find those at a point of parameters.
#[derive(Debug)]
pub struct Index {
    key: &'static str,
    /// Value and row, ascending.
    rows: Vec<(f64, usize)>,
}

impl Index {
    /// Over the parameter that varies most.
    pub fn new(rows: &[ForeignRow]) -> Self {
        let values = |name: &str| -> BTreeSet<u64> {
            rows.iter().filter_map(|r| r.parameters.get(name)).map(|v| v.to_bits()).collect()
        };
        let key = PARAMETERS.iter().map(|p| p.name).max_by_key(|name| values(name).len());
        let key = key.unwrap_or_default();
        let value = |row: &ForeignRow| row.parameters.get(key).copied().unwrap_or_default();
        let mut sorted: Vec<(f64, usize)> =
            rows.iter().enumerate().map(|(i, row)| (value(row), i)).collect();
        sorted.sort_by(|a, b| a.0.total_cmp(&b.0));
        Self { key, rows: sorted }
    }

    /// Rows that lie at a point of parameters.
    pub fn at<'a>(
        &'a self,
        rows: &'a [ForeignRow],
        parameters: &'a BTreeMap<String, f64>,
    ) -> impl Iterator<Item = usize> + 'a {
        let value = parameters.get(self.key).copied().unwrap_or_default();
        let from = self.rows.partition_point(|(v, _)| *v < value && !is_same(*v, value));
        let near = self.rows[from..].iter().take_while(move |(v, _)| is_same(*v, value));
        near.map(|(_, i)| *i).filter(move |i| rows[*i].is_at(parameters))
    }
}

/// Whether a run is the plain steady state at its parameters: no table along the fjord, no shape of the melt,
/// whatever it told beside.
pub fn is_plain(run_id: &str, parameters: &BTreeMap<String, f64>, closure: &str) -> bool {
    (0..8_u8).any(|options| {
        let mut document = Document { regime: Some(Regime::Steady), ..Document::default() };
        document.options.upstream_closure = Some(closure.to_owned());
        document.options.grid_error = Some(options & 1 != 0);
        document.options.sensitivities = Some(options & 2 != 0);
        document.options.discrete_roots = Some(options & 4 != 0);
        let entries = parameters.iter().map(|(name, value)| (name.clone(), *value));
        document.parameters.0 = entries.collect();
        document.into_run().is_ok_and(|run| run.id() == run_id)
    })
}

/// A result beside this model's.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, ToSchema)]
pub struct Beside {
    /// What the table has.
    pub foreign: f64,
    /// What this model has; null if the run has no such number.
    pub ours: Option<f64>,
    /// (foreign − ours)/|ours|; null where there is no such number.
    pub relative: Option<f64>,
}

impl Beside {
    /// The two beside each other.
    pub fn new(foreign: f64, ours: Option<f64>) -> Self {
        let relative = ours.map(|ours| (foreign - ours) / ours.abs()).filter(|r| r.is_finite());
        Self { foreign, ours, relative }
    }
}

/// Differences of one result over all rows that have a run.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
pub struct Spread {
    /// Rows compared.
    pub n: usize,
    /// Median of the absolute relative differences.
    pub median: f64,
    /// The largest one.
    pub largest: f64,
    /// The row that has it.
    pub largest_in_row: usize,
}

/// The spread of relative differences, each with its row; none if there are none.
pub fn spread(mut differences: Vec<(usize, f64)>) -> Option<Spread> {
    differences.iter_mut().for_each(|(_, d)| *d = d.abs());
    differences.sort_by(|a, b| a.1.total_cmp(&b.1));
    let n = differences.len();
    let (largest_in_row, largest) = *differences.last()?;
    let median = (differences[(n - 1) / 2].1 + differences[n / 2].1) / 2.0;
    Some(Spread { n, median, largest, largest_in_row })
}

#[cfg(test)]
mod tests {
    use super::*;

    const MAP: &str = r#"
        source = "somebody, 2024, their code"
        [columns]
        melt_rate_m_per_day = { column = "melt" }
        width_m = { value = 4000 }
        force_n_per_m = { column = "F (MN/m)", scale = 1e6 }
        length_m = { column = "L (km)", scale = 1e3 }
    "#;

    #[test]
    fn a_table_is_read_by_its_map() {
        let csv = b"melt,F (MN/m),what,L (km)\n0.6,8.16,x,12\n0.7, 7.5 ,y,\n";
        let table = ColumnMap::parse(MAP).and_then(|map| map.read(csv)).expect("a table");
        assert_eq!(table.ignored, ["what"]);
        assert_eq!(table.rows.len(), 2);
        let row = &table.rows[0];
        assert_eq!(row.results.get("force_n_per_m"), Some(&8.16e6));
        assert_eq!(row.parameters.get("melt_rate_m_per_day"), Some(&0.6));
        assert_eq!(row.parameters.len(), PARAMETERS.len());
        assert_eq!(table.rows[1].results.get("length_m"), None);
        let index = Index::new(&table.rows);
        let mut at = table.rows[1].parameters.clone();
        at.insert("melt_rate_m_per_day".into(), 0.7 * (1.0 + 1e-10));
        assert_eq!(index.at(&table.rows, &at).collect::<Vec<_>>(), [1]);
        at.insert("width_m".into(), 4001.0);
        assert_eq!(index.at(&table.rows, &at).count(), 0);
    }

    #[test]
    fn what_would_have_to_be_guessed_is_refused() {
        let field = |map: &str, csv: &str| {
            let read = ColumnMap::parse(map).and_then(|map| map.read(csv.as_bytes()));
            read.expect_err("refused").field.unwrap_or_default()
        };
        let good = "melt,F (MN/m),L (km)\n0.6,8,12\n";
        assert_eq!(field(&MAP.replace("source", "sauce"), good), "map");
        assert_eq!(field(&MAP.replace("somebody, 2024, their code", " "), good), "source");
        assert_eq!(field(&MAP.replace("width_m", "width"), good), "columns.width");
        assert_eq!(
            field(&MAP.replace("scale = 1e6", "scale = 0.0"), good),
            "columns.force_n_per_m"
        );
        assert_eq!(
            field(&MAP.replace("column = \"melt\"", "scale = 2.0"), good),
            "columns.melt_rate_m_per_day"
        );
        let missing = "columns.melt_rate_m_per_day.column";
        assert_eq!(field(MAP, "F (MN/m),L (km)\n8,12\n"), missing);
        assert_eq!(field(MAP, "melt,melt,F (MN/m),L (km)\n1,1,8,12\n"), missing);
        assert_eq!(field(MAP, "melt,F (MN/m),L (km)\n,8,12\n"), "table.rows[0][0]");
        assert_eq!(field(MAP, "melt,F (MN/m),L (km)\n0.6,8 MN,12\n"), "table.rows[0][1]");
        assert_eq!(field(MAP, "melt,F (MN/m),L (km)\n0.6,nan,12\n"), "table.rows[0][1]");
        assert_eq!(field(MAP, "melt,F (MN/m),L (km)\n"), "table.rows");
    }

    #[test]
    fn a_spread_has_its_median_and_its_worst_row() {
        let told = spread(vec![(0, -0.1), (1, 0.3), (2, 0.2), (3, 0.0)]).expect("a spread");
        assert_eq!((told.n, told.largest, told.largest_in_row), (4, 0.3, 1));
        assert!((told.median - 0.15).abs() < 1e-15);
        assert_eq!(spread(Vec::new()), None);
    }
}
