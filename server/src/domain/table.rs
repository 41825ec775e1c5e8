//! A sweep whose points are the rows of a table, from a document or from CSV. Kept by columns, so that a
//! million rows take 8 bytes a number.

use super::axes::{Column, known_name};
use super::refusal::Refusal;
use super::run::closure_of_name;
use melange_solver::physics::closure::UpstreamClosure;
use serde::de::{DeserializeSeed, Deserializer, Error, MapAccess, SeqAccess, Unexpected, Visitor};
use serde::ser::{SerializeSeq, SerializeStruct};
use serde::{Deserialize, Serialize, Serializer};
use std::fmt;
use std::sync::Arc;

/// `{"columns": […], "rows": [[…]]}`: a run for each row, with the columns' parameters put in.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct TableForm {
    columns: Vec<String>,
    cells: Vec<Cells>,
}

/// The cells of a column.
#[derive(Debug, Clone, PartialEq)]
pub enum Cells {
    /// Values of a parameter.
    Numbers(Arc<Vec<f64>>),
    /// Closures.
    Closures(Arc<Vec<UpstreamClosure>>),
}

impl Cells {
    fn len(&self) -> usize {
        match self {
            Self::Numbers(values) => values.len(),
            Self::Closures(values) => values.len(),
        }
    }
}

/// The column that holds names instead of numbers.
pub const CLOSURE: &str = "upstream_closure";
/// What a cell of that column may be.
const CLOSURES: &str = "published, printed or no_stretching";

impl TableForm {
    /// A table of columns that are there already, all of the same length.
    pub fn of_columns(columns: Vec<String>, cells: Vec<Cells>) -> Self {
        Self { columns, cells }
    }

    /// Its first rows.
    pub fn head(&self, rows: usize) -> Self {
        let head = |cells: &Cells| match cells {
            Cells::Numbers(values) => {
                Cells::Numbers(Arc::new(values.iter().take(rows).copied().collect()))
            }
            Cells::Closures(values) => {
                Cells::Closures(Arc::new(values.iter().take(rows).copied().collect()))
            }
        };
        Self { columns: self.columns.clone(), cells: self.cells.iter().map(head).collect() }
    }

    /// A table from CSV: commas between cells, the first row names the columns.
    pub fn from_csv(bytes: &[u8]) -> Result<Self, Refusal> {
        let bytes = bytes.strip_prefix("\u{feff}".as_bytes()).unwrap_or(bytes);
        let mut reader =
            csv::ReaderBuilder::new().flexible(true).trim(csv::Trim::All).from_reader(bytes);
        let unreadable = |e: csv::Error| Refusal {
            field: Some("table".into()),
            permitted: Some("CSV in UTF-8 whose first row names the columns".into()),
            ..Refusal::sentence(format!("the table is not readable as CSV: {e}"))
        };
        let header = reader.headers().map_err(unreadable)?.clone();
        let mut gathering = Gathering::of(header.iter().map(str::to_owned).collect());
        let mut record = csv::StringRecord::new();
        while reader.read_record(&mut record).map_err(unreadable)? {
            let row = gathering.rows;
            for (column, text) in record.iter().enumerate().take(gathering.width()) {
                let number = text.parse().ok().filter(|v: &f64| v.is_finite());
                let cell = number.map_or(Cell::Text(text), Cell::Number);
                if gathering.put(column, cell).is_err() {
                    let field = format!("table.rows[{row}][{column}]");
                    return Err(Refusal::value(field, text, gathering.permitted(column)));
                }
            }
            if record.len() != gathering.width() {
                let field = format!("table.rows[{row}]");
                return Err(Refusal::value(field, record.len(), gathering.whole_row()));
            }
            gathering.rows += 1;
        }
        Ok(gathering.table())
    }

    /// Number of rows.
    pub fn rows(&self) -> usize {
        self.cells.first().map_or(0, Cells::len)
    }

    /// Checks names of columns, of which nothing but the names need be known.
    pub fn check_names(columns: &[String]) -> Result<(), Refusal> {
        for (i, name) in columns.iter().enumerate() {
            let field = format!("table.columns[{i}]");
            if name != CLOSURE {
                known_name(&field, name)?;
            }
            if columns[..i].contains(name) {
                return Err(Refusal::value(field, name.as_str(), "each column once"));
            }
        }
        Ok(())
    }

    /// The columns, checked by their names.
    pub fn lanes(&self) -> Result<Vec<Column>, Refusal> {
        if self.columns.is_empty() {
            return Err(Refusal::value("table.columns", Vec::<String>::new(), "at least one name"));
        }
        if self.columns.len() != self.cells.len() {
            let permitted = format!("as many names as a row has cells, {}", self.cells.len());
            return Err(Refusal::value("table.columns", self.columns.clone(), permitted));
        }
        if self.rows() == 0 {
            return Err(Refusal::value("table.rows", Vec::<f64>::new(), "at least one row"));
        }
        Self::check_names(&self.columns)?;
        let mut lanes = Vec::with_capacity(self.columns.len());
        for (i, (name, cells)) in self.columns.iter().zip(&self.cells).enumerate() {
            let field = format!("table.columns[{i}]");
            lanes.push(match (name.as_str(), cells) {
                (CLOSURE, Cells::Closures(closures)) => Column::Closure(closures.clone()),
                (CLOSURE, Cells::Numbers(values)) => {
                    return Err(Refusal::number(
                        format!("table.rows[0][{i}]"),
                        values[0],
                        CLOSURES,
                    ));
                }
                (_, Cells::Numbers(values)) => {
                    Column::Parameter(known_name(&field, name)?, values.clone())
                }
                (_, Cells::Closures(closures)) => {
                    known_name(&field, name)?;
                    let permitted = format!("a finite number in column `{name}`");
                    let field = format!("table.rows[0][{i}]");
                    return Err(Refusal::value(field, closures[0].name(), permitted));
                }
            });
        }
        Ok(lanes)
    }
}

enum Cell<'a> {
    Number(f64),
    Text(&'a str),
}

enum Gathered {
    Numbers(Vec<f64>),
    Closures(Vec<UpstreamClosure>),
}

/// A table that is being read. Columns whose names come after the rows take the kind of their first cell.
#[derive(Default)]
struct Gathering {
    columns: Option<Vec<String>>,
    cells: Vec<Gathered>,
    rows: usize,
}

impl Gathering {
    fn of(columns: Vec<String>) -> Self {
        let cells = columns.iter().map(|name| match name.as_str() {
            CLOSURE => Gathered::Closures(Vec::new()),
            _ => Gathered::Numbers(Vec::new()),
        });
        Self { cells: cells.collect(), columns: Some(columns), rows: 0 }
    }

    fn width(&self) -> usize {
        self.cells.len()
    }

    /// Takes the next cell of the row that is being read, if it fits.
    fn put(&mut self, column: usize, cell: Cell<'_>) -> Result<(), ()> {
        if column == self.width() && self.columns.is_none() && self.rows == 0 {
            self.cells.push(match cell {
                Cell::Number(_) => Gathered::Numbers(Vec::new()),
                Cell::Text(_) => Gathered::Closures(Vec::new()),
            });
        }
        match (self.cells.get_mut(column), cell) {
            (Some(Gathered::Numbers(values)), Cell::Number(value)) if value.is_finite() => {
                values.push(value);
            }
            (Some(Gathered::Closures(closures)), Cell::Text(text)) => {
                closures.push(closure_of_name("", text).map_err(drop)?);
            }
            _ => return Err(()),
        }
        Ok(())
    }

    /// What a cell of the row that is being read may be.
    fn permitted(&self, column: usize) -> String {
        let kind = match self.cells.get(column) {
            Some(Gathered::Numbers(_)) => "a finite number",
            Some(Gathered::Closures(_)) => CLOSURES,
            None => "a finite number or the name of a closure",
        };
        let name = self.columns.as_ref().and_then(|names| names.get(column));
        let name = name.map_or_else(|| (column + 1).to_string(), |name| format!("`{name}`"));
        format!("{kind} in row {}, column {name}", self.rows + 1)
    }

    /// What the row that is being read has to have.
    fn whole_row(&self) -> String {
        format!("{} cells in row {}, one for each column", self.width(), self.rows + 1)
    }

    fn table(self) -> TableForm {
        let cells = self.cells.into_iter().map(|cells| match cells {
            Gathered::Numbers(mut values) => {
                values.shrink_to_fit();
                Cells::Numbers(Arc::new(values))
            }
            Gathered::Closures(mut closures) => {
                closures.shrink_to_fit();
                Cells::Closures(Arc::new(closures))
            }
        });
        TableForm { cells: cells.collect(), columns: self.columns.unwrap_or_default() }
    }
}

impl<'de> Deserialize<'de> for TableForm {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_map(Members)
    }
}

struct Members;

impl<'de> Visitor<'de> for Members {
    type Value = TableForm;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(r#"{"columns": [names], "rows": [[cells]]}"#)
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<TableForm, A::Error> {
        let mut columns: Option<Vec<String>> = None;
        let mut gathering = None;
        while let Some(member) = map.next_key::<String>()? {
            match member.as_str() {
                "columns" if columns.is_none() => columns = Some(map.next_value()?),
                "rows" if gathering.is_none() => {
                    let named = columns.clone().map_or_else(Gathering::default, Gathering::of);
                    gathering = Some(map.next_value_seed(Rows(named))?);
                }
                "columns" => return Err(A::Error::duplicate_field("columns")),
                "rows" => return Err(A::Error::duplicate_field("rows")),
                other => return Err(A::Error::unknown_field(other, &["columns", "rows"])),
            }
        }
        let columns = columns.ok_or_else(|| A::Error::missing_field("columns"))?;
        let gathering: Gathering = gathering.ok_or_else(|| A::Error::missing_field("rows"))?;
        Ok(TableForm { columns, ..gathering.table() })
    }
}

struct Rows(Gathering);

impl<'de> DeserializeSeed<'de> for Rows {
    type Value = Gathering;

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<Gathering, D::Error> {
        deserializer.deserialize_seq(self)
    }
}

impl<'de> Visitor<'de> for Rows {
    type Value = Gathering;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("rows, each a list of cells")
    }

    fn visit_seq<A: SeqAccess<'de>>(mut self, mut rows: A) -> Result<Gathering, A::Error> {
        while rows.next_element_seed(Row(&mut self.0))?.is_some() {
            self.0.rows += 1;
        }
        Ok(self.0)
    }
}

struct Row<'a>(&'a mut Gathering);

impl<'de> DeserializeSeed<'de> for Row<'_> {
    type Value = ();

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<(), D::Error> {
        deserializer.deserialize_seq(self)
    }
}

impl<'de> Visitor<'de> for Row<'_> {
    type Value = ();

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0.whole_row())
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut cells: A) -> Result<(), A::Error> {
        let may_grow = self.0.columns.is_none() && self.0.rows == 0;
        let mut length = 0;
        while may_grow || length < self.0.width() {
            let place = CellAt { gathering: &mut *self.0, column: length };
            if cells.next_element_seed(place)?.is_none() {
                break;
            }
            length += 1;
        }
        while cells.next_element::<serde::de::IgnoredAny>()?.is_some() {
            length += 1;
        }
        if length == self.0.width() { Ok(()) } else { Err(A::Error::invalid_length(length, &self)) }
    }
}

struct CellAt<'a> {
    gathering: &'a mut Gathering,
    column: usize,
}

impl<'de> DeserializeSeed<'de> for CellAt<'_> {
    type Value = ();

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<(), D::Error> {
        deserializer.deserialize_any(self)
    }
}

impl CellAt<'_> {
    fn put<E: Error>(self, cell: Cell<'_>, given: Unexpected<'_>) -> Result<(), E> {
        let Self { gathering, column } = self;
        gathering
            .put(column, cell)
            .map_err(|()| E::invalid_value(given, &gathering.permitted(column).as_str()))
    }
}

impl<'de> Visitor<'de> for CellAt<'_> {
    type Value = ();

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.gathering.permitted(self.column))
    }

    fn visit_f64<E: Error>(self, value: f64) -> Result<(), E> {
        self.put(Cell::Number(value), Unexpected::Float(value))
    }

    fn visit_i64<E: Error>(self, value: i64) -> Result<(), E> {
        self.put(Cell::Number(value as f64), Unexpected::Signed(value))
    }

    fn visit_u64<E: Error>(self, value: u64) -> Result<(), E> {
        self.put(Cell::Number(value as f64), Unexpected::Unsigned(value))
    }

    fn visit_str<E: Error>(self, text: &str) -> Result<(), E> {
        self.put(Cell::Text(text), Unexpected::Str(text))
    }
}

impl Serialize for TableForm {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut members = serializer.serialize_struct("table", 2)?;
        members.serialize_field("columns", &self.columns)?;
        members.serialize_field("rows", &WrittenRows(self))?;
        members.end()
    }
}

struct WrittenRows<'a>(&'a TableForm);

impl Serialize for WrittenRows<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_seq((0..self.0.rows()).map(|row| WrittenRow(self.0, row)))
    }
}

struct WrittenRow<'a>(&'a TableForm, usize);

impl Serialize for WrittenRow<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let Self(table, row) = *self;
        let mut cells = serializer.serialize_seq(Some(table.cells.len()))?;
        for column in &table.cells {
            match column {
                Cells::Numbers(values) => cells.serialize_element(&values[row])?,
                Cells::Closures(closures) => cells.serialize_element(closures[row].name())?,
            }
        }
        cells.end()
    }
}
