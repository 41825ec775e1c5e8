//! A sweep whose points are drawn: quasi-random, stratified or random, and the same for ever. Whatever is
//! random comes from blake3 of seed, method and parameter's name, and logarithms from `libm`, so that
//! neither a library's generator nor a platform's mathematics changes a point.

use super::axes::{Column, Columns, known_name};
use super::entries::Entries;
use super::refusal::Refusal;
use melange_solver::params::{self, ParameterInfo};
use serde::de::{Deserializer, Error, MapAccess, SeqAccess, Visitor};
use serde::{Deserialize, Serialize, Serializer};
use sobol::Sobol;
use sobol::params::JoeKuoD6;
use std::fmt;
use std::sync::Arc;
use utoipa::ToSchema;

mod saltelli;
pub use saltelli::Design;

/// Points drawn from ranges. The order in which the ranges are written does not matter.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct SampleForm {
    /// How they are drawn.
    pub method: Method,
    /// Number of points; of a design of Saltelli's, of base points, each of which is d + 2 runs in d parameters.
    pub n: u64,
    /// Another seed gives other points; 0 if not given.
    #[serde(default)]
    pub seed: u64,
    /// By parameter: `[smallest, largest]`, or `{"log": [smallest, largest]}`.
    #[schema(value_type = std::collections::BTreeMap<String, Object>)]
    pub ranges: Entries<RangeForm>,
}

/// How points are drawn.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum Method {
    /// Sobol's sequence, shifted at random digit by digit.
    Sobol,
    /// Each parameter's n strata are hit once each.
    LatinHypercube,
    /// Independent points.
    Uniform,
    /// Independent points, every range logarithmic.
    LogUniform,
    /// Saltelli's design, of which sensitivity indices are made: n base points of Sobol's sequence, each with d + 2
    /// runs in d parameters. With A and B from the sequence's first and last d coordinates, these are A, then for
    /// each parameter in alphabetical order A with that parameter from B, then B.
    Saltelli,
}

impl Method {
    /// Name at every boundary.
    pub fn name(self) -> &'static str {
        match self {
            Self::Sobol => "sobol",
            Self::LatinHypercube => "latin_hypercube",
            Self::Uniform => "uniform",
            Self::LogUniform => "log_uniform",
            Self::Saltelli => "saltelli",
        }
    }
}

/// A range to draw from.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum RangeForm {
    /// Evenly from the first number to the second.
    Linear([f64; 2]),
    /// Evenly in the logarithm.
    Log([f64; 2]),
}

/// Bits of a random fraction: all that an f64 below 1 has.
const FRACTION_BITS: u32 = 53;
/// Bits of a place within a stratum: with 2²⁴ strata, stratum and place together have no more than an
/// f64 holds exactly.
const JITTER_BITS: u32 = 28;
/// The largest number below 1.
const BELOW_ONE: f64 = 1.0 - f64::EPSILON / 2.0;

impl SampleForm {
    /// Number of points that it makes, each a run.
    pub fn count(&self) -> usize {
        match self.method {
            Method::Saltelli => saltelli::runs(self.drawn(), self.ranges.0.len()),
            _ => self.drawn(),
        }
    }

    /// Which n are permitted where a sweep has at most so many runs.
    pub fn permitted(&self, most: usize) -> String {
        match self.method {
            Method::Saltelli => {
                let each = saltelli::runs(1, self.ranges.0.len());
                format!("at most {most} runs, and each base point is {each} of them")
            }
            _ => format!("at most {most} runs"),
        }
    }

    fn drawn(&self) -> usize {
        usize::try_from(self.n).unwrap_or(usize::MAX)
    }

    /// The points, a column for each range in the alphabetical order of their names.
    pub fn columns(&self) -> Result<Columns, Refusal> {
        if self.n == 0 {
            return Err(Refusal::value("sample.n", 0, "at least one point"));
        }
        let mut ranges = Vec::with_capacity(self.ranges.0.len());
        for (name, range) in &self.ranges.0 {
            ranges.push(Range::checked(name, *range, self.method)?);
        }
        ranges.sort_by_key(|range| range.name);
        if let Some(twice) = ranges.windows(2).find(|r| r[0].name == r[1].name) {
            let field = format!("sample.ranges.{}", twice[1].name);
            return Err(Refusal::value(field, twice[1].ends.to_vec(), "each name once"));
        }
        if ranges.is_empty() {
            let none = serde_json::Map::new();
            return Err(Refusal::value("sample.ranges", none, "at least one parameter's range"));
        }
        let directions = match self.method {
            Method::Saltelli => return saltelli::columns(self, &ranges),
            Method::Sobol => directions(ranges.len()),
            _ => vec![Vec::new(); ranges.len()],
        };
        let columns = ranges.iter().zip(&directions).map(|(range, directions)| {
            let values = self.fractions(range.name, directions).map(|u| range.value(u)).collect();
            Column::Parameter(range.name, Arc::new(values))
        });
        Ok(columns.collect())
    }

    /// n numbers from 0 up to but not including 1.
    fn fractions<'a>(
        &self,
        name: &str,
        directions: &'a [u64],
    ) -> Box<dyn Iterator<Item = f64> + 'a> {
        let n = self.drawn();
        match self.method {
            Method::Sobol | Method::Saltelli => Box::new(self.shifted("shift", name, directions)),
            Method::LatinHypercube => Box::new(self.stratified(name)),
            Method::Uniform | Method::LogUniform => {
                let mut stream = self.stream("point", name);
                Box::new(
                    (0..n).map(move |_| stream.bits() as f64 / (1_u64 << FRACTION_BITS) as f64),
                )
            }
        }
    }

    /// Sobol's sequence in one dimension, with a shift of its own by purpose and name.
    fn shifted<'a>(
        &self,
        purpose: &str,
        name: &str,
        directions: &'a [u64],
    ) -> impl Iterator<Item = f64> + use<'a> {
        shifted_sobol(self.drawn(), self.stream(purpose, name).bits(), directions)
    }

    /// One number in each of n strata of equal width, in random order and at a random place of each.
    fn stratified(&self, name: &str) -> impl Iterator<Item = f64> + use<> {
        let n = self.drawn();
        let mut order = self.stream("order", name);
        let mut strata: Vec<(u64, u32)> = (0..n as u32).map(|i| (order.bits(), i)).collect();
        strata.sort_unstable();
        let mut jitter = self.stream("jitter", name);
        strata.into_iter().map(move |(_, stratum)| {
            let place = jitter.bits() >> (FRACTION_BITS - JITTER_BITS);
            let place = (place as f64 + 0.5) / (1_u64 << JITTER_BITS) as f64;
            ((f64::from(stratum) + place) / n as f64).min(BELOW_ONE)
        })
    }

    fn stream(&self, purpose: &str, name: &str) -> Stream {
        let mut hasher = blake3::Hasher::new();
        for text in ["melange-sample 1", self.method.name(), purpose, name] {
            hasher.update(&(text.len() as u64).to_le_bytes());
            hasher.update(text.as_bytes());
        }
        hasher.update(&self.seed.to_le_bytes());
        Stream { reader: hasher.finalize_xof(), block: [0; 64], used: 64 }
    }
}

/// Random bits, as many as are asked for.
struct Stream {
    reader: blake3::OutputReader,
    block: [u8; 64],
    used: usize,
}

impl Stream {
    /// The next 53 of them.
    fn bits(&mut self) -> u64 {
        if self.used == self.block.len() {
            self.reader.fill(&mut self.block);
            self.used = 0;
        }
        let eight = &self.block[self.used..self.used + 8];
        self.used += 8;
        let number = u64::from_le_bytes(eight.try_into().expect("eight bytes are a u64"));
        number >> (u64::BITS - FRACTION_BITS)
    }
}

/// Direction numbers of Joe and Kuo (2008) for so many dimensions, the first bit of the fraction
/// highest.
fn directions(dimensions: usize) -> Vec<Vec<u64>> {
    let resolution = FRACTION_BITS as usize;
    Sobol::<u64>::init_direction_vals::<u32>(dimensions, resolution, &JoeKuoD6::minimal())
}

/// The first n points of Sobol's sequence in one dimension, the first at 0, in the order of Antonov and
/// Saleev's Gray code; each digit is flipped where `shift` has a one, which keeps the net.
fn shifted_sobol(n: usize, shift: u64, directions: &[u64]) -> impl Iterator<Item = f64> {
    let unused = u64::BITS - FRACTION_BITS;
    let mut digits = 0_u64;
    (0..n).map(move |i| {
        if i > 0 {
            digits ^= directions[(i - 1).trailing_ones() as usize];
        }
        ((digits >> unused) ^ shift) as f64 / (1_u64 << FRACTION_BITS) as f64
    })
}

/// A checked range.
struct Range {
    name: &'static str,
    ends: [f64; 2],
    /// Where the share of the last number ends.
    end: f64,
    /// Of the first number and of that end.
    logs: Option<[f64; 2]>,
    is_whole: bool,
}

impl Range {
    fn checked(name: &str, form: RangeForm, method: Method) -> Result<Self, Refusal> {
        let field = format!("sample.ranges.{name}");
        let name = known_name(&field, name)?;
        let (ends, is_log) = match form {
            RangeForm::Linear(ends) => (ends, method == Method::LogUniform),
            RangeForm::Log(ends) => (ends, true),
        };
        let info = params::info(name);
        for end in ends {
            if !end.is_finite() || info.is_some_and(|info| info.check(end).is_err()) {
                let permitted = match info {
                    Some(_) => params::permitted(name),
                    None => "a finite number".into(),
                };
                return Err(Refusal::number(field, end, permitted));
            }
            if is_log && end <= 0.0 {
                let permitted = "a number above 0, since the range is logarithmic";
                return Err(Refusal::number(field, end, permitted));
            }
        }
        if ends[0] >= ends[1] {
            return Err(Refusal::value(field, ends.to_vec(), "the smaller end first"));
        }
        let is_whole = info.is_some_and(|ParameterInfo { whole, .. }| *whole);
        // Of whole numbers each has the same share, the last one too.
        let end = if is_whole { ends[1] + 1.0 } else { ends[1] };
        let logs = is_log.then(|| [ends[0], end].map(libm::log));
        Ok(Self { name, ends, end, logs, is_whole })
    }

    /// The value at u, from 0 to 1. Rounding never leads out of the range.
    fn value(&self, u: f64) -> f64 {
        let [first, last] = self.ends;
        let value = match self.logs {
            Some([from, to]) => libm::exp(from + (to - from) * u),
            None => first + (self.end - first) * u,
        };
        (if self.is_whole { value.floor() } else { value }).clamp(first, last)
    }
}

impl Serialize for RangeForm {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self {
            Self::Linear(ends) => ends.serialize(serializer),
            Self::Log(ends) => serializer.collect_map([("log", ends)]),
        }
    }
}

impl<'de> Deserialize<'de> for RangeForm {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        const FORMS: &str = r#"[smallest, largest] or {"log": [smallest, largest]}"#;
        struct Forms;
        impl<'de> Visitor<'de> for Forms {
            type Value = RangeForm;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str(FORMS)
            }

            fn visit_seq<A: SeqAccess<'de>>(self, mut ends: A) -> Result<RangeForm, A::Error> {
                let mut two = [0.0; 2];
                for (i, end) in two.iter_mut().enumerate() {
                    let found = ends.next_element()?;
                    *end = found.ok_or_else(|| A::Error::invalid_length(i, &FORMS))?;
                }
                match ends.next_element::<f64>()? {
                    Some(_) => Err(A::Error::invalid_length(3, &FORMS)),
                    None => Ok(RangeForm::Linear(two)),
                }
            }

            fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<RangeForm, A::Error> {
                let mut log = None;
                while let Some(name) = map.next_key::<String>()? {
                    if name != "log" || log.is_some() {
                        let sentence = format!("`{name}` has no place here; expected {FORMS}");
                        return Err(A::Error::custom(sentence));
                    }
                    log = Some(map.next_value()?);
                }
                let sentence = || A::Error::custom(format!("nothing is there; expected {FORMS}"));
                log.map(RangeForm::Log).ok_or_else(sentence)
            }
        }
        deserializer.deserialize_any(Forms)
    }
}

#[cfg(test)]
mod tests;
