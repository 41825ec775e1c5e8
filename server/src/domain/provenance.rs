//! Where a run's numbers come from: which model, program and host solved it, from what, and how long that
//! took; and the scenario that it can be solved from again.

use super::document::Document;
use super::effective::WIDTHS;
use super::entries::Entries;
use super::identity::MODEL_VERSION;
use super::run::RunSpec;
use melange_solver::params::{PARAMETERS, Parameters};
use serde::Serialize;
use serde_json::Value;
use std::sync::Arc;
use utoipa::ToSchema;

/// Version of the program and name of the build, which hangs on its code, its compiler and the compiler's
/// settings.
pub const PROGRAM_VERSION: &str = concat!(env!("CARGO_PKG_VERSION"), "+", env!("MELANGE_BUILD"));

/// Longest options that are stored with every run, in bytes; beyond, tables of forcing or widths stand in the
/// sweep's document alone.
pub const LONGEST_OPTIONS: usize = 16 << 10;

/// Where a run's numbers come from. Null is what was not kept when it was solved.
#[derive(Debug, Clone, Default, PartialEq, Serialize, ToSchema)]
pub struct Provenance {
    /// Version of the model's numbers, part of the run's identity.
    pub model_version: Option<String>,
    /// Version of the program and, after `+`, name of the build: two builds share it only if they have the same
    /// code, compiler and settings.
    pub program_version: Option<String>,
    /// What of the host may change last digits or the time: architecture, system, vector instructions,
    /// processor.
    pub host_class: Option<String>,
    /// Time that a thread spent on the run, all attempts together, s.
    pub solve_seconds: Option<f64>,
    /// Seed of a calibration's samples (or else of its starts), or of the sample that drew the run's parameters
    /// for the sweep that solved it; null where nothing is drawn.
    pub seed: Option<u64>,
    /// What the search for a steady state began from: its `own` start, a `neighbour`, or by `continuation` from
    /// one after its own start had led nowhere.
    pub start: Option<&'static str>,
    /// That neighbour's run.
    pub started_from: Option<String>,
    /// When the run was stored, RFC 3339 in UTC.
    pub solved_at: Option<String>,
    /// The run as a scenario that `melange run` solves, and that has the same identity; null where its tables are
    /// longer than 16 KiB, which the document of its sweep has.
    #[schema(value_type = Option<Object>)]
    pub scenario: Option<Value>,
    /// What identifies the run beside its parameters and its closure, as JSON: the scenario without them.
    #[serde(skip)]
    pub options: Option<Arc<str>>,
}

/// What a search for a steady state begins from, by name.
pub const STARTS: [&str; 3] = ["own", "neighbour", "continuation"];

/// A column of the table of runs that tells where they come from.
#[derive(Debug, Clone, Copy)]
pub struct ColumnInfo {
    /// Name at every boundary.
    pub name: &'static str,
    /// Unit, "1" for dimensionless.
    pub unit: &'static str,
    /// Meaning.
    pub meaning: &'static str,
}

/// The columns, in stored order.
pub const COLUMNS: &[ColumnInfo] = &[
    ColumnInfo {
        name: "model_version",
        unit: "1",
        meaning: "version of the model's numbers, part of the run's identity",
    },
    ColumnInfo {
        name: "program_version",
        unit: "1",
        meaning: "version of the program and, after +, name of the build, which hangs on code, compiler and settings",
    },
    ColumnInfo {
        name: "host_class",
        unit: "1",
        meaning: "what of the host may change last digits or the time: architecture, system, vector instructions, processor",
    },
    ColumnInfo {
        name: "solve_seconds",
        unit: "s",
        meaning: "time that a thread spent on the run, all attempts together",
    },
    ColumnInfo {
        name: "seed",
        unit: "1",
        meaning: "seed of a calibration's samples, or else of its starts; or of the sample that drew the run's parameters for the sweep that solved it; null where nothing is drawn",
    },
    ColumnInfo {
        name: "start",
        unit: "1",
        meaning: "what the search for a steady state began from: its own start, a neighbour, or by continuation from one",
    },
    ColumnInfo {
        name: "started_from",
        unit: "1",
        meaning: "run_id of that neighbour; null for its own start",
    },
    ColumnInfo {
        name: "options",
        unit: "1",
        meaning: "the run's scenario without its parameters and closure, as JSON; null if longer than 16 KiB, where the sweep's document has it",
    },
];

impl Provenance {
    /// Of a run that this program has solved; what it began from is added by who knows.
    pub fn here(host_class: &str, options: Option<Arc<str>>, solve_seconds: f64) -> Self {
        Self {
            model_version: Some(MODEL_VERSION.into()),
            program_version: Some(PROGRAM_VERSION.into()),
            host_class: Some(host_class.into()),
            solve_seconds: Some(solve_seconds),
            start: Some(STARTS[0]),
            options,
            ..Self::default()
        }
    }
}

impl Document {
    /// What identifies the document's runs beside their parameters and closure, as JSON; none if that is long.
    pub fn options_of_runs(&self) -> Option<Arc<str>> {
        self.options_of_any_length().filter(|text| text.len() <= LONGEST_OPTIONS)
    }

    /// The same, however long.
    pub fn options_of_any_length(&self) -> Option<Arc<str>> {
        let document = Self {
            regime: self.regime,
            start: self.start.clone(),
            time: self.time.clone(),
            options: self.options.clone(),
            melt_shape: self.melt_shape.clone(),
            fjord: self.fjord.clone(),
            forcing: self.forcing.clone(),
            calving_law: self.calving_law,
            length_m: self.length_m,
            thickness_0_m: self.thickness_0_m,
            volume_m3: self.volume_m3,
            branch: self.branch.clone(),
            fold_curve: self.fold_curve.clone(),
            calibration: self.calibration.clone(),
            ..Self::default()
        };
        serde_json::to_string(&document).ok().map(Into::into)
    }
}

/// The scenario of a run, from what identifies it beside parameters and closure; none if that is no JSON of ours.
pub fn scenario(
    options: &str,
    upstream_closure: &str,
    parameters: &Parameters,
) -> Option<Document> {
    let mut document: Document = serde_json::from_str(options).ok()?;
    document.options.upstream_closure = Some(upstream_closure.to_owned());
    // A table of widths stands for these.
    let is_written = |name: &str| document.fjord.is_none() || !WIDTHS.contains(&name);
    let written = PARAMETERS.iter().filter(|info| is_written(info.name));
    let values = written.map(|info| (info.name.to_owned(), (info.get)(parameters)));
    document.parameters = Entries(values.collect());
    Some(document)
}

impl RunSpec {
    /// Seed of what a run itself draws: of a calibration's samples, or else of its starts.
    pub fn seed(&self) -> Option<u64> {
        let what = self.shared.calibrating.as_ref()?;
        let samples = what.mcmc.as_ref().map(|plan| plan.seed);
        samples.or(Some(what.fit.seed).filter(|_| what.fit.starts > 1))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::domain::sweep::Limits;

    /// Every kind of run is itself again from its row.
    #[test]
    fn a_run_is_rebuilt_from_options_closure_and_parameters() {
        for document in [
            r#"{"regime": "steady", "axes": [{"option": "upstream_closure", "values": ["no_stretching", "published"]},
                {"parameter": "calving_flux_m2_per_a", "linspace": [3e6, 4e6, 3]}]}"#,
            r#"{"regime": "steady", "options": {"grid_error": true, "sensitivities": true, "discrete_roots": true},
                "fjord": {"x_m": [0, 1e5], "width_m": [4000, 4100], "beyond": "constant"},
                "melt_shape": {"chi": [0, 1], "factor": [2, 1]},
                "sample": {"method": "sobol", "n": 4, "seed": 3, "ranges": {"b": {"log": [1e4, 1e5]}}}}"#,
            r#"{"regime": "quasi_static", "volume_m3": 1e10, "parameters": {"water_drag_n_per_m": -0.0}}"#,
            r#"{"regime": "diagnostic", "start": {"length_m": 10000, "thickness_0_m": 75}}"#,
            r#"{"regime": "transient", "start": {"run": "0123456789abcdef"}, "calving_law": "steady_feedback",
                "forcing": {"mu_s": {"table": {"time_a": [0, 1], "value": [0.3, 0.2]}}},
                "options": {"lagged": true},
                "time": {"duration_a": 1, "fixed_dt_a": 0.01, "output_every_a": 0.1, "profiles_at_a": [0.5, 1]}}"#,
            r#"{"regime": "branch", "calving_law": {"rate_m_per_a": 7000},
                "branch": {"control": "mu_s", "from": 0.2, "to": 0.4, "roots_at": [0.35, 0.3]}}"#,
            r#"{"regime": "fold_curve", "fold_curve": {"control": "melt_rate_m_per_day", "from": 0.1,
                "to": 0.7, "second": "width_m", "second_from": 3e3, "second_to": 5e3}}"#,
            r#"{"regime": "calibration", "calibration": {"parameters": {"mu_s": [0.1, 0.6]}, "starts": 2,
                "mcmc": {"walkers": 8, "steps": 40}, "observations": [
                    {"quantity": "length_m", "value": 11000, "standard_error": 100},
                    {"quantity": "force_n_per_m", "value": 1e7, "standard_error": 1e5}]}}"#,
        ] {
            let sweep = Document::parse(document).and_then(|d| d.into_sweep(&Limits::MOST));
            let sweep = sweep.unwrap_or_else(|e| panic!("{e}: {document}"));
            for index in 0..sweep.count() {
                let run = sweep.run(index);
                let options = sweep.options().expect("short options");
                let closure = run.model.closure().name();
                let scenario = scenario(&options, closure, run.parameters()).expect("a document");
                let text = serde_json::to_string(&scenario).expect("JSON");
                let again = Document::parse(&text).and_then(Document::into_run);
                let again = again.unwrap_or_else(|e| panic!("{e}: {text}"));
                assert_eq!(again.id(), run.id(), "{text}");
                assert_eq!(again.model, run.model);
            }
        }
    }

    #[test]
    fn long_tables_are_left_to_the_sweep() {
        let x_m: Vec<f64> = (0..3000).map(f64::from).collect();
        let fjord =
            serde_json::json!({"x_m": x_m, "width_m": vec![4000.0; 3000], "beyond": "constant"});
        let text = serde_json::json!({"regime": "steady", "fjord": fjord}).to_string();
        assert_eq!(Document::parse(&text).expect("a document").options_of_runs(), None);
    }

    #[test]
    fn only_what_is_drawn_has_a_seed() {
        let seed = |document: &str| {
            Document::parse(document).and_then(Document::into_run).expect("a run").seed()
        };
        assert_eq!(seed(r#"{"regime": "steady"}"#), None);
        let calibration = |more: &str| {
            format!(
                r#"{{"regime": "calibration", "calibration": {{"parameters": {{"mu_s": [0.1, 0.6]}}, {more},
                    "observations": [{{"quantity": "length_m", "value": 11000, "standard_error": 100}}]}}}}"#
            )
        };
        assert_eq!(seed(&calibration(r#""starts": 1, "seed": 5"#)), None);
        assert_eq!(seed(&calibration(r#""starts": 2, "seed": 5"#)), Some(5));
        let sampled = r#""seed": 5, "mcmc": {"walkers": 8, "steps": 40, "seed": 6}"#;
        assert_eq!(seed(&calibration(sampled)), Some(6));
    }
}
