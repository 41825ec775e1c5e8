//! The NetCDF file under way: dimensions, variables and their CF attributes. Knows no table.

use super::About;
use crate::archive::ArchiveError;
use netcdf_writer::{
    DimensionId, NcAttrValue, NcFileBuilder, NcWriteFormat, NcWriteOptions, NcWriteType, VariableId,
};
use std::io::{self, Write};

/// Version of the CF conventions that the files follow.
const CONVENTIONS: &str = "CF-1.11";
/// The paper of the model.
const PAPER: &str = "Amundson, J. M., Robel, A. A., Burton, J. C., and Nissanka, K. (2025): a quasi-one-dimensional \
                     ice mélange flow model, The Cryosphere, 19, 19-35, https://doi.org/10.5194/tc-19-19-2025";
const COMMENT: &str = "Years are Julian years of 365.25 days, times are since the start of a run. chi is the share of \
                       the melange's length, x the distance from the terminus. Text that does not exist is empty. \
                       Branches, folds, sensitivities, discrete roots, calibrations and residual histories are in \
                       the sweep's Parquet tables.";
/// Level of deflate: higher ones gain little.
const DEFLATE: u8 = 4;
/// Numbers of a chunk, 512 KiB.
const CHUNK: u64 = 1 << 16;

/// A variable before its values.
#[derive(Debug, Clone, Copy)]
pub struct Variable<'a> {
    /// Name.
    pub name: &'a str,
    /// Names of its dimensions.
    pub dimensions: &'a [&'static str],
    /// Unit as melange has it.
    pub unit: &'a str,
    /// Meaning.
    pub meaning: &'a str,
    /// Names of the coordinates it lies at, apart from its dimensions'; none for a coordinate.
    pub coordinates: &'a str,
}

/// A file under way.
#[derive(Debug)]
pub struct Dataset {
    builder: NcFileBuilder,
    dimensions: Vec<(&'static str, DimensionId, u64)>,
}

impl Dataset {
    /// Without any variable.
    pub fn new(about: &About) -> Result<Self, ArchiveError> {
        let mut builder = NcFileBuilder::new();
        let version = env!("CARGO_PKG_VERSION");
        let title = match about.name.as_str() {
            "" => "ice melange ensemble".to_owned(),
            name => format!("ice melange ensemble: {name}"),
        };
        for (name, text) in [
            ("Conventions", CONVENTIONS.to_owned()),
            ("title", title),
            ("source", format!("melange {version}, quasi-one-dimensional ice melange model")),
            ("history", format!("{}: sweep {} submitted", about.submitted_at, about.sweep_id)),
            ("references", PAPER.to_owned()),
            ("comment", COMMENT.to_owned()),
            ("melange_sweep_id", about.sweep_id.clone()),
            ("melange_version", version.to_owned()),
        ] {
            builder.add_attribute(name, NcAttrValue::Chars(text)).map_err(fault)?;
        }
        Ok(Self { builder, dimensions: Vec::new() })
    }

    /// Adds a dimension of at least one.
    pub fn dimension(&mut self, name: &'static str, size: usize) -> Result<(), ArchiveError> {
        let id = self.builder.add_dimension(name, size as u64).map_err(fault)?;
        self.dimensions.push((name, id, size as u64));
        Ok(())
    }

    /// Adds numbers; NaN where there is none.
    pub fn reals(&mut self, variable: Variable<'_>, values: &[f64]) -> Result<(), ArchiveError> {
        let id = self.add::<f64>(variable)?;
        if !is_coordinate(variable) {
            self.builder.set_variable_fill_value(id, f64::NAN).map_err(fault)?;
        }
        self.values(id, values)
    }

    /// Adds whole numbers; a fill value stands where there is none.
    pub fn wholes(
        &mut self,
        variable: Variable<'_>,
        values: impl Iterator<Item = Option<i64>>,
    ) -> Result<(), ArchiveError> {
        let id = self.add::<i64>(variable)?;
        let mut has_gaps = false;
        let filled = |value: Option<i64>| {
            has_gaps |= value.is_none();
            value.unwrap_or(netcdf_writer::NC_FILL_INT64)
        };
        let values: Vec<i64> = values.map(filled).collect();
        if has_gaps {
            let fill = netcdf_writer::NC_FILL_INT64;
            self.builder.set_variable_fill_value(id, fill).map_err(fault)?;
        }
        self.values(id, &values)
    }

    /// Adds flags: the place of each meaning is its value; -1 where there is none.
    pub fn flags(
        &mut self,
        variable: Variable<'_>,
        meanings: &[&str],
        values: &[i8],
    ) -> Result<(), ArchiveError> {
        let id = self.add::<i8>(variable)?;
        if values.contains(&-1) {
            self.builder.set_variable_fill_value(id, -1_i8).map_err(fault)?;
        }
        let flags = NcAttrValue::Bytes((0..meanings.len() as i8).collect());
        self.builder.add_variable_attribute(id, "flag_values", flags).map_err(fault)?;
        self.attribute(id, "flag_meanings", &meanings.join(" "))?;
        self.values(id, values)
    }

    /// Adds texts.
    pub fn texts<S: AsRef<str>>(
        &mut self,
        variable: Variable<'_>,
        values: &[S],
    ) -> Result<(), ArchiveError> {
        let (dimensions, _) = self.shape(variable)?;
        let id = self.builder.add_string_variable(variable.name, &dimensions).map_err(fault)?;
        self.attribute(id, "long_name", variable.meaning)?;
        if !variable.coordinates.is_empty() {
            self.attribute(id, "coordinates", variable.coordinates)?;
        }
        self.builder.write_string_variable(id, values).map_err(fault)
    }

    /// Writes the file.
    pub fn write(self, target: impl Write) -> Result<(), ArchiveError> {
        let options = NcWriteOptions { format: NcWriteFormat::Nc4 };
        self.builder.write(target, options).map(drop).map_err(fault)
    }

    fn add<T: NcWriteType>(&mut self, variable: Variable<'_>) -> Result<VariableId, ArchiveError> {
        let (dimensions, sizes) = self.shape(variable)?;
        let id = self.builder.add_variable::<T>(variable.name, &dimensions).map_err(fault)?;
        // From the last dimension on as much as goes into a chunk.
        let mut left = CHUNK;
        let mut chunk: Vec<u64> = Vec::with_capacity(sizes.len());
        for size in sizes.iter().rev() {
            let along = (*size).min(left).max(1);
            left = (left / along).max(1);
            chunk.insert(0, along);
        }
        self.builder.set_variable_chunking(id, chunk).map_err(fault)?;
        self.builder.set_variable_deflate(id, Some(DEFLATE), true).map_err(fault)?;
        self.attribute(id, "long_name", variable.meaning)?;
        self.attribute(id, "units", &udunits(variable.unit))?;
        if !variable.coordinates.is_empty() {
            self.attribute(id, "coordinates", variable.coordinates)?;
        }
        Ok(id)
    }

    fn shape(&self, variable: Variable<'_>) -> Result<(Vec<DimensionId>, Vec<u64>), ArchiveError> {
        let of = |name: &&str| {
            let found = self.dimensions.iter().find(|(known, _, _)| known == name);
            found.map(|(_, id, size)| (*id, *size))
        };
        let found: Option<Vec<_>> = variable.dimensions.iter().map(of).collect();
        let missing = || unwritten(io::Error::other(format!("no dimension of {}", variable.name)));
        Ok(found.ok_or_else(missing)?.into_iter().unzip())
    }

    fn values<T: NcWriteType>(&mut self, id: VariableId, values: &[T]) -> Result<(), ArchiveError> {
        self.builder.write_variable(id, values).map_err(fault)
    }

    fn attribute(&mut self, id: VariableId, name: &str, text: &str) -> Result<(), ArchiveError> {
        let text = NcAttrValue::Chars(text.to_owned());
        self.builder.add_variable_attribute(id, name, text).map_err(fault)
    }
}

/// What could not be written.
pub fn unwritten(source: io::Error) -> ArchiveError {
    ArchiveError::File { path: "a NetCDF dataset".into(), doing: "written", source }
}

fn fault(error: netcdf_writer::Error) -> ArchiveError {
    match error {
        netcdf_writer::Error::Io(error) => unwritten(error),
        error => unwritten(io::Error::other(error)),
    }
}

/// Whether CF takes it for the coordinate of its dimension, which has no gaps.
fn is_coordinate(variable: Variable<'_>) -> bool {
    variable.dimensions == [variable.name]
}

/// A unit as UDUNITS has it, to which `a` is an are, and `year` the tropical year.
fn udunits(unit: &str) -> String {
    let name = |part: &str| match part.strip_prefix('a') {
        Some(power) if power.parse::<i8>().is_ok() || power.is_empty() => {
            format!("Julian_year{power}")
        }
        _ => part.to_owned(),
    };
    unit.split(' ').map(name).collect::<Vec<_>>().join(" ")
}

#[cfg(test)]
mod tests {
    use super::udunits;
    use crate::archive::netcdf::KINDS;

    #[test]
    fn years_are_julian_and_other_units_are_known() {
        assert_eq!(udunits("m a-1"), "m Julian_year-1");
        assert_eq!(udunits("a"), "Julian_year");
        for kind in KINDS {
            for field in kind.schema().fields() {
                let unit = udunits(&field.metadata()["unit"]);
                for part in unit.split(' ') {
                    let base = part.trim_end_matches(|c: char| c == '-' || c.is_ascii_digit());
                    let known = ["", "m", "d", "s", "N", "Julian_year"].contains(&base);
                    assert!(known, "{}: {unit}", field.name());
                }
            }
        }
    }
}
