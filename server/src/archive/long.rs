//! Long tables in Parquet, whichever they are: fields, columns and rows by what the domain says of them.

use super::SolvedRun;
use super::schema::{field, list_of_numbers, list_of_wholes, run_id_field};
use crate::domain::outcome::Outcome;
use crate::domain::rows::{Cell, CellType, Row};
use arrow_array::builder::{
    BooleanBuilder, Float64Builder, Int64Builder, ListBuilder, StringBuilder,
};
use arrow_array::cast::AsArray;
use arrow_array::types::{Float64Type, Int64Type};
use arrow_array::{Array, ArrayRef, RecordBatch};
use arrow_schema::{DataType, Field};
use std::sync::Arc;

/// The table's fields: the run's id, then the columns of its rows.
pub fn fields<R: Row>() -> Vec<Field> {
    let mut fields = vec![run_id_field()];
    for column in R::columns() {
        let kind = match column.cells {
            CellType::Text => DataType::Utf8,
            CellType::Whole => DataType::Int64,
            CellType::Real => DataType::Float64,
            CellType::Flag => DataType::Boolean,
            CellType::Numbers => list_of_numbers(),
            CellType::Wholes => list_of_wholes(),
        };
        fields.push(field(&column.name, kind, true, &column.unit, &column.meaning));
    }
    fields
}

/// The rows of runs, column by column.
pub fn columns<R: Row>(runs: &[SolvedRun], rows_of: impl Fn(&Outcome) -> &[R]) -> Vec<ArrayRef> {
    let rows = || runs.iter().flat_map(|run| rows_of(&run.outcome).iter().map(move |r| (run, r)));
    let mut ids = StringBuilder::new();
    rows().for_each(|(run, _)| ids.append_value(&run.run_id));
    let mut columns: Vec<ArrayRef> = vec![Arc::new(ids.finish())];
    for (i, column) in R::columns().iter().enumerate() {
        let mut builder = Builder::new(column.cells);
        rows().for_each(|(_, row)| builder.append(row.cell(i)));
        columns.push(builder.finish());
    }
    columns
}

/// A row of a batch; a column that is younger than the file is none.
pub fn row<R: Row>(batch: &RecordBatch, row: usize) -> R {
    let mut read = R::default();
    for (i, column) in R::columns().iter().enumerate() {
        let Some(array) = batch.column_by_name(&column.name) else { continue };
        if array.is_valid(row)
            && let Some(cell) = cell(array, row, column.cells)
        {
            read.put(i, cell);
        }
    }
    read
}

/// The cell of an array; none if it is of another type.
fn cell(array: &ArrayRef, row: usize, cells: CellType) -> Option<Cell> {
    Some(match cells {
        CellType::Text => Cell::Text(Some(array.as_string_opt::<i32>()?.value(row).to_owned())),
        CellType::Whole => Cell::Whole(Some(array.as_primitive_opt::<Int64Type>()?.value(row))),
        CellType::Real => Cell::Real(Some(array.as_primitive_opt::<Float64Type>()?.value(row))),
        CellType::Flag => Cell::Flag(Some(array.as_boolean_opt()?.value(row))),
        CellType::Numbers => {
            let list = array.as_list_opt::<i32>()?.value(row);
            Cell::Numbers(Some(list.as_primitive_opt::<Float64Type>()?.values().to_vec()))
        }
        CellType::Wholes => {
            let list = array.as_list_opt::<i32>()?.value(row);
            Cell::Wholes(Some(list.as_primitive_opt::<Int64Type>()?.values().to_vec()))
        }
    })
}

/// A column under way.
enum Builder {
    Text(StringBuilder),
    Whole(Int64Builder),
    Real(Float64Builder),
    Flag(BooleanBuilder),
    Numbers(ListBuilder<Float64Builder>),
    Wholes(ListBuilder<Int64Builder>),
}

impl Builder {
    fn new(cells: CellType) -> Self {
        match cells {
            CellType::Text => Self::Text(StringBuilder::new()),
            CellType::Whole => Self::Whole(Int64Builder::new()),
            CellType::Real => Self::Real(Float64Builder::new()),
            CellType::Flag => Self::Flag(BooleanBuilder::new()),
            CellType::Numbers => Self::Numbers(ListBuilder::new(Float64Builder::new())),
            CellType::Wholes => Self::Wholes(ListBuilder::new(Int64Builder::new())),
        }
    }

    fn append(&mut self, cell: Cell) {
        match (self, cell) {
            (Self::Text(column), Cell::Text(text)) => column.append_option(text),
            (Self::Whole(column), Cell::Whole(number)) => column.append_option(number),
            (Self::Real(column), Cell::Real(number)) => column.append_option(number),
            (Self::Flag(column), Cell::Flag(flag)) => column.append_option(flag),
            (Self::Numbers(column), Cell::Numbers(numbers)) => {
                column.values().append_slice(numbers.as_deref().unwrap_or_default());
                column.append(numbers.is_some());
            }
            (Self::Wholes(column), Cell::Wholes(numbers)) => {
                column.values().append_slice(numbers.as_deref().unwrap_or_default());
                column.append(numbers.is_some());
            }
            (_, cell) => unreachable!("a column has cells of its own type, and not {cell:?}"),
        }
    }

    fn finish(self) -> ArrayRef {
        match self {
            Self::Text(mut column) => Arc::new(column.finish()),
            Self::Whole(mut column) => Arc::new(column.finish()),
            Self::Real(mut column) => Arc::new(column.finish()),
            Self::Flag(mut column) => Arc::new(column.finish()),
            Self::Numbers(mut column) => Arc::new(column.finish()),
            Self::Wholes(mut column) => Arc::new(column.finish()),
        }
    }
}
