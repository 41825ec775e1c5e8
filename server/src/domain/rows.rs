//! Long tables, of which a run has any number of rows: the columns of a row by name, and its cells by column.
//! What stores and shows rows needs to know no more. Numbers that do not exist are `None`, never NaN.

use serde::ser::{SerializeMap, Serializer};
use utoipa::openapi::schema::{ArrayBuilder, ObjectBuilder, Type};
use utoipa::openapi::{RefOr, Schema};

/// A row of a long table.
pub trait Row: Default {
    /// The table's columns, in stored order.
    fn columns() -> &'static [Column];
    /// The cell of a column.
    fn cell(&self, column: usize) -> Cell;
    /// Puts a cell into a column of its type.
    fn put(&mut self, column: usize, cell: Cell);
}

/// One column.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Column {
    /// Name at every boundary.
    pub name: String,
    /// Unit, "1" for dimensionless.
    pub unit: String,
    /// Meaning.
    pub meaning: String,
    /// What its cells are.
    pub cells: CellType,
}

/// What the cells of a column are.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum CellType {
    Text,
    Whole,
    Real,
    Flag,
    Numbers,
    Wholes,
}

/// One cell.
#[derive(Debug, Clone, PartialEq)]
pub enum Cell {
    /// A name or a sentence.
    Text(Option<String>),
    /// A whole number.
    Whole(Option<i64>),
    /// A finite number.
    Real(Option<f64>),
    /// Whether something is so.
    Flag(Option<bool>),
    /// Finite numbers.
    Numbers(Option<Vec<f64>>),
    /// Whole numbers.
    Wholes(Option<Vec<i64>>),
}

/// What a column can hold.
pub trait Value: Sized {
    /// As what.
    const CELLS: CellType;
    /// As a cell; what is not finite is none.
    fn into_cell(value: Option<Self>) -> Cell;
    /// Out of a cell; none out of one of another type.
    fn of_cell(cell: Cell) -> Option<Self>;
}

macro_rules! value {
    ($type:ty, $cell:ident, $is_kept:expr) => {
        impl Value for $type {
            const CELLS: CellType = CellType::$cell;

            fn into_cell(value: Option<Self>) -> Cell {
                Cell::$cell(value.filter($is_kept))
            }

            fn of_cell(cell: Cell) -> Option<Self> {
                if let Cell::$cell(value) = cell { value } else { None }
            }
        }
    };
}

value!(String, Text, |_| true);
value!(i64, Whole, |_| true);
value!(f64, Real, |number| number.is_finite());
value!(bool, Flag, |_| true);
value!(Vec<f64>, Numbers, |numbers| numbers.iter().all(|n| n.is_finite()));
value!(Vec<i64>, Wholes, |_| true);

/// A row with a member for each column: its type, unit and meaning.
macro_rules! row {
    ($(#[$doc:meta])* $row:ident; $($field:ident: $type:ty, $unit:literal, $meaning:literal;)*) => {
        $(#[$doc])*
        #[derive(Debug, Clone, Default, PartialEq)]
        pub struct $row {
            $(#[doc = $meaning] pub $field: Option<$type>,)*
        }

        const _: () = {
            use crate::domain::rows::{Cell, Column, Row, Value};
            use std::sync::LazyLock;

            static COLUMNS: LazyLock<Vec<Column>> = LazyLock::new(|| vec![
                $(Column {
                    name: stringify!($field).into(),
                    unit: $unit.into(),
                    meaning: $meaning.into(),
                    cells: <$type as Value>::CELLS,
                },)*
            ]);

            type Get = fn(&$row) -> Cell;
            type Set = fn(&mut $row, Cell);

            const CELLS: &[(Get, Set)] = &[
                $((
                    |row| Value::into_cell(row.$field.clone()),
                    |row, cell| row.$field = <$type as Value>::of_cell(cell),
                ),)*
            ];

            impl Row for $row {
                fn columns() -> &'static [Column] {
                    &COLUMNS
                }

                fn cell(&self, column: usize) -> Cell {
                    CELLS[column].0(self)
                }

                fn put(&mut self, column: usize, cell: Cell) {
                    CELLS[column].1(self, cell);
                }
            }
        };
    };
}

pub(crate) use row;

/// Writes a row as members by column's name, without the columns that are left out.
pub fn serialize<R: Row, S: Serializer>(
    row: &R,
    is_left_out: impl Fn(&Column, &Cell) -> bool,
    serializer: S,
) -> Result<S::Ok, S::Error> {
    let mut map = serializer.serialize_map(None)?;
    for (i, column) in R::columns().iter().enumerate() {
        let cell = row.cell(i);
        if is_left_out(column, &cell) {
            continue;
        }
        match &cell {
            Cell::Text(text) => map.serialize_entry(&column.name, text)?,
            Cell::Whole(number) => map.serialize_entry(&column.name, number)?,
            Cell::Real(number) => map.serialize_entry(&column.name, number)?,
            Cell::Flag(flag) => map.serialize_entry(&column.name, flag)?,
            Cell::Numbers(numbers) => map.serialize_entry(&column.name, numbers)?,
            Cell::Wholes(numbers) => map.serialize_entry(&column.name, numbers)?,
        }
    }
    map.end()
}

/// A row as the interface's document describes it: its members, without those that are left out.
pub fn schema<R: Row>(is_left_out: impl Fn(&Column) -> bool) -> RefOr<Schema> {
    let mut object = ObjectBuilder::new();
    for column in R::columns().iter().filter(|column| !is_left_out(column)) {
        let described = match column.unit.as_str() {
            "1" => column.meaning.clone(),
            unit => format!("{} ({unit})", column.meaning),
        };
        let one = |kind| ObjectBuilder::new().schema_type(kind);
        let member: Schema = match column.cells {
            CellType::Text => one(Type::String).description(Some(described)).into(),
            CellType::Whole => one(Type::Integer).description(Some(described)).into(),
            CellType::Real => one(Type::Number).description(Some(described)).into(),
            CellType::Flag => one(Type::Boolean).description(Some(described)).into(),
            CellType::Numbers => {
                ArrayBuilder::new().items(one(Type::Number)).description(Some(described)).into()
            }
            CellType::Wholes => {
                ArrayBuilder::new().items(one(Type::Integer)).description(Some(described)).into()
            }
        };
        object = object.property(&column.name, member);
    }
    object.into()
}

impl Cell {
    /// Whether there is nothing in it.
    pub fn is_none(&self) -> bool {
        matches!(
            self,
            Self::Text(None)
                | Self::Whole(None)
                | Self::Real(None)
                | Self::Flag(None)
                | Self::Numbers(None)
                | Self::Wholes(None)
        )
    }
}
