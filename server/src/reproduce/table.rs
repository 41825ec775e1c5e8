//! Tables of names and numbers, and how they are written: CSV in full, text and Markdown in short.

use serde::Serialize;
use std::fmt::Write as _;
use std::io::Write;

/// A value in a table.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(untagged)]
pub enum Cell {
    /// A number.
    Number(f64),
    /// A name.
    Text(String),
}

impl From<f64> for Cell {
    fn from(value: f64) -> Self {
        Self::Number(value)
    }
}

impl From<&str> for Cell {
    fn from(text: &str) -> Self {
        Self::Text(text.to_owned())
    }
}

impl Cell {
    fn short(&self) -> String {
        match self {
            Self::Number(value) => short(*value),
            Self::Text(text) => text.clone(),
        }
    }
}

/// A table; its columns carry their units in their names.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Table {
    /// Name of its file.
    pub name: &'static str,
    /// Its heading.
    pub title: &'static str,
    /// What it shows.
    pub caption: &'static str,
    /// Names of the columns.
    pub columns: Vec<String>,
    /// Its rows.
    pub rows: Vec<Vec<Cell>>,
}

impl Table {
    /// A figure's data.
    pub fn data(name: &'static str, columns: &[&str], rows: Vec<Vec<Cell>>) -> Self {
        let columns = columns.iter().map(|c| (*c).to_owned()).collect();
        Self { name, title: "", caption: "", columns, rows }
    }

    /// Every number with all its digits.
    pub fn write_csv(&self, file: impl Write) -> std::io::Result<()> {
        let mut writer = csv::Writer::from_writer(file);
        writer.write_record(&self.columns)?;
        for row in &self.rows {
            writer.write_record(row.iter().map(|cell| match cell {
                Cell::Number(value) => value.to_string(),
                Cell::Text(text) => text.clone(),
            }))?;
        }
        writer.flush()
    }

    /// In columns of equal width.
    pub fn as_text(&self) -> String {
        let rows: Vec<Vec<String>> = std::iter::once(self.columns.clone())
            .chain(self.rows.iter().map(|row| row.iter().map(Cell::short).collect()))
            .collect();
        let width = |c: usize| rows.iter().map(|r| r[c].chars().count()).max().unwrap_or_default();
        let widths: Vec<usize> = (0..self.columns.len()).map(width).collect();
        let mut text = String::new();
        for row in &rows {
            for (cell, width) in row.iter().zip(&widths) {
                write!(text, "  {cell:>width$}").expect("memory");
            }
            text.push('\n');
        }
        text
    }

    /// As a table of Markdown.
    pub fn as_markdown(&self) -> String {
        let line = |cells: Vec<String>| format!("| {} |\n", cells.join(" | "));
        let names = self.columns.iter().map(|name| format!("`{name}`")).collect();
        let rows = self.rows.iter().map(|row| line(row.iter().map(Cell::short).collect()));
        line(names)
            + &format!("|{}\n", "---|".repeat(self.columns.len()))
            + &rows.collect::<String>()
    }
}

/// A number with five digits.
pub fn short(value: f64) -> String {
    /// Digits.
    const DIGITS: i32 = 5;
    let scientific = format!("{value:.*e}", DIGITS as usize - 1);
    let Some((_, exponent)) = scientific.split_once('e') else { return scientific };
    match exponent.parse::<i32>() {
        // Whole numbers as such.
        Ok(0..=6) if value.fract() == 0.0 => format!("{value}"),
        Ok(exponent @ -3..DIGITS) => format!("{value:.*}", (DIGITS - 1 - exponent) as usize),
        _ => scientific,
    }
}
