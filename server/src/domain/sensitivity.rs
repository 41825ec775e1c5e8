//! How the numbers of a steady state change with its parameters, as stored and as shown: the long table
//! `sensitivities`.

use super::outcome::SCALARS;
use super::rows::{self, Cell, CellType, Column, Row};
use melange_solver::physics::given::Given;
use melange_solver::sensitivity::Quantity;
use serde::ser::{Serialize, Serializer};
use std::sync::LazyLock;
use utoipa::openapi::{RefOr, Schema};
use utoipa::{PartialSchema, ToSchema};

/// Parameters that are differentiated by.
pub const PARAMETERS: usize = Given::ALL.len();

/// Their names, in their order.
pub fn parameters() -> impl Iterator<Item = &'static str> {
    Given::ALL.into_iter().map(|given| given.info().name)
}

/// A quantity and its derivatives by everything.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct SensitivityRow {
    /// Its name among a result's numbers.
    pub quantity: String,
    /// Its value.
    pub value: Option<f64>,
    /// dQ/dp by each parameter, in the order of [`Given::ALL`].
    pub by: [Option<f64>; PARAMETERS],
    /// d ln Q/d ln p; none where either is 0, or where a table stands for the parameter.
    pub log_by: [Option<f64>; PARAMETERS],
    /// By the melt rate of each cell, per m a⁻¹.
    pub by_melt: Option<Vec<f64>>,
}

/// Columns before those of the parameters.
const BEFORE: usize = 3;
/// Place of the melt's column.
const MELT: usize = BEFORE + 2 * PARAMETERS;

static COLUMNS: LazyLock<Vec<Column>> = LazyLock::new(|| {
    let column = |name: &str, cells, unit: &str, meaning: &str| Column {
        name: name.into(),
        unit: unit.into(),
        meaning: meaning.into(),
        cells,
    };
    let mut columns = vec![
        column("quantity", CellType::Text, "1", "name of the quantity Q"),
        column("unit", CellType::Text, "1", "unit of the quantity"),
        column("value", CellType::Real, "see unit", "value of the quantity"),
    ];
    for info in Given::ALL.map(Given::info) {
        let per = format!("(unit) per ({})", info.unit);
        let meaning = format!("dQ/dp by the {}", info.meaning);
        columns.push(column(&format!("by_{}", info.name), CellType::Real, &per, &meaning));
    }
    for info in Given::ALL.map(Given::info) {
        let meaning = format!(
            "d ln Q/d ln p = p/Q dQ/dp by the {}; null where p or Q is 0, or a table gives p",
            info.meaning
        );
        columns.push(column(&format!("log_by_{}", info.name), CellType::Real, "1", &meaning));
    }
    let meaning = "dQ/d(melt rate) by the melt rate of each cell alone, from the terminus to the end; N times \
                   this is the functional derivative by the melt rate over chi";
    let per = "(unit) per (m a-1)";
    columns.push(column("by_melt_per_m_per_a", CellType::Numbers, per, meaning));
    columns
});

impl SensitivityRow {
    /// Numbers that a run of so many cells stores.
    pub fn numbers(n_cells: usize) -> usize {
        Quantity::ALL.len() * (1 + 2 * PARAMETERS + n_cells)
    }
}

/// Unit of a number of a result.
fn unit_of(quantity: &str) -> Option<String> {
    SCALARS.iter().find(|info| info.name == quantity).map(|info| info.unit.to_owned())
}

impl PartialSchema for SensitivityRow {
    fn schema() -> RefOr<Schema> {
        rows::schema::<Self>(|_| false)
    }
}

impl ToSchema for SensitivityRow {}

impl Row for SensitivityRow {
    fn columns() -> &'static [Column] {
        &COLUMNS
    }

    fn cell(&self, column: usize) -> Cell {
        match column {
            0 => Cell::Text(Some(self.quantity.clone())),
            1 => Cell::Text(unit_of(&self.quantity)),
            2 => Cell::Real(self.value),
            MELT => Cell::Numbers(self.by_melt.clone()),
            _ if column < BEFORE + PARAMETERS => Cell::Real(self.by[column - BEFORE]),
            _ => Cell::Real(self.log_by[column - BEFORE - PARAMETERS]),
        }
    }

    fn put(&mut self, column: usize, cell: Cell) {
        match (column, cell) {
            (0, Cell::Text(text)) => self.quantity = text.unwrap_or_default(),
            (2, Cell::Real(value)) => self.value = value,
            (MELT, Cell::Numbers(by_melt)) => self.by_melt = by_melt,
            (column, Cell::Real(value)) if column < BEFORE + PARAMETERS => {
                self.by[column - BEFORE] = value;
            }
            (column, Cell::Real(value)) => self.log_by[column - BEFORE - PARAMETERS] = value,
            // The unit follows from the quantity.
            _ => {}
        }
    }
}

impl Serialize for SensitivityRow {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        rows::serialize(self, |_, _| false, serializer)
    }
}
