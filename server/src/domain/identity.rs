//! What makes two runs the same run: model version, options and parameters, as bits.

use super::branch::Following;
use super::calibration::Calibrating;
use super::document::Document;
use super::forcing::CalvingForm;
use super::run::RunSpec;
use super::start::Start;
use super::time::{SeriesAt, Steps};
use melange_solver::params::PARAMETERS;
use melange_solver::quasi_static::Given;
use melange_solver::transient::Stepping;

/// Version of the model's numbers. Raised when a run's result changes by more than the tolerance it is
/// solved to, so that old results are not taken for new ones.
pub const MODEL_VERSION: &str = "melange-model 2";

/// All versions there were, the present one first.
pub const MODEL_VERSIONS: [&str; 2] = [MODEL_VERSION, "melange-model 1"];

/// Hex digits of a run's id: 128 bits of the blake3 hash.
pub const ID_DIGITS: usize = 32;

impl RunSpec {
    /// The run's id: blake3 of everything its result depends on, numbers as IEEE-754 bits with −0 as 0.
    /// Each part is preceded by a tag, and each text by its length. What is not given leaves no trace.
    pub fn id(&self) -> String {
        self.id_of_model(None)
    }

    /// The id it has, or had, under a version of the model; this one if none is given.
    pub fn id_of_model(&self, model_version: Option<&str>) -> String {
        let shared = &self.shared;
        let mut key = Key::default();
        key.text("model", model_version.unwrap_or(MODEL_VERSION));
        key.text("regime", shared.regime.name());
        key.text("upstream_closure", self.model.closure().name());
        for info in &PARAMETERS {
            key.number(info.name, (info.get)(self.parameters()));
        }
        match &shared.start {
            None => {}
            Some(Start::Steady) => key.text("start", "steady"),
            Some(Start::Wedge(wedge)) => {
                key.number("start.length_m", wedge.length_m);
                key.number("start.thickness_0_m", wedge.thickness_0_m);
            }
            Some(Start::Run(id)) => key.text("start.run", id),
        }
        if let Some(steps) = &shared.steps {
            key.steps(steps);
        }
        match shared.given {
            None => {}
            Some(Given::Length(m)) => key.number("length_m", m),
            Some(Given::Thickness0(m)) => key.number("thickness_0_m", m),
            Some(Given::Volume(m3)) => key.number("volume_m3", m3),
        }
        if let Some(following) = &shared.following {
            key.following(following);
        }
        if let Some(calibrating) = &shared.calibrating {
            key.calibrating(calibrating);
        }
        if shared.is_lagged {
            key.text("lagged", "true");
        }
        if shared.grid_error {
            key.text("grid_error", "true");
        }
        if shared.sensitivities {
            key.text("sensitivities", "true");
        }
        if shared.discrete_roots {
            key.text("discrete_roots", "true");
        }
        if let Some(digest) = &shared.digest {
            key.text("along and in time", digest);
        }
        key.digits()
    }
}

/// Hash of what varies along the fjord and in time, which the runs of a document share; none if nothing
/// does.
pub fn digest(document: &Document) -> Option<String> {
    let mut key = Key::default();
    if let Some(fjord) = &document.fjord {
        let (beyond, columns) = fjord.parts();
        key.text("fjord", beyond);
        columns.iter().for_each(|column| key.numbers("fjord", column));
    }
    if let Some(melt) = &document.melt_shape {
        let (name, columns) = melt.parts();
        if name != "uniform" {
            key.text("melt_shape", &name);
            columns.iter().for_each(|column| key.numbers("melt_shape", column));
        }
    }
    let mut courses: Vec<_> = document.forcing.0.iter().collect();
    courses.sort_by(|a, b| a.0.cmp(&b.0));
    for (name, course) in courses {
        let (kind, numbers) = course.parts();
        key.text("forcing", name);
        key.text("forcing", kind);
        key.numbers("forcing", &numbers);
    }
    match document.calving_law {
        None => {}
        Some(CalvingForm::SteadyFeedback) => key.text("calving_law", "steady_feedback"),
        Some(CalvingForm::Law(law)) => key.numbers(
            "calving_law",
            &[
                law.rate_m_per_a,
                law.per_force_m2_per_a_n,
                law.per_advance_per_a,
                law.thickness_per_advance,
            ],
        ),
    }
    (!key.bytes.is_empty()).then(|| key.digits())
}

/// What is to be hashed, gathered first and hashed at once.
struct Key {
    bytes: Vec<u8>,
}

impl Default for Key {
    fn default() -> Self {
        /// Room for the key of any run without lists; longer ones grow.
        const ROOM: usize = 1024;
        Self { bytes: Vec::with_capacity(ROOM) }
    }
}

impl Key {
    fn text(&mut self, tag: &str, text: &str) {
        for part in [tag, text] {
            self.bytes.extend_from_slice(&(part.len() as u64).to_le_bytes());
            self.bytes.extend_from_slice(part.as_bytes());
        }
    }

    fn number(&mut self, tag: &str, value: f64) {
        let canonical = if value == 0.0 { 0.0_f64 } else { value };
        self.bytes.extend_from_slice(&(tag.len() as u64).to_le_bytes());
        self.bytes.extend_from_slice(tag.as_bytes());
        self.bytes.extend_from_slice(&canonical.to_bits().to_le_bytes());
    }

    fn numbers(&mut self, tag: &str, values: &[f64]) {
        self.number(tag, values.len() as f64);
        values.iter().for_each(|value| self.number(tag, *value));
    }

    fn steps(&mut self, steps: &Steps) {
        match &steps.stepping {
            Stepping::Fixed { dt_a, count } => {
                self.number("dt_a", *dt_a);
                self.number("steps", *count as f64);
            }
            Stepping::Controlled { tolerance, land_on_a } => {
                self.number("tolerance", *tolerance);
                self.numbers("land_on_a", land_on_a);
            }
        }
        match &steps.series_at {
            SeriesAt::EveryStep => {}
            SeriesAt::Every(every) => self.number("series_every", *every as f64),
            SeriesAt::These(landings) => {
                self.number("series_at", landings.len() as f64);
                landings.iter().for_each(|k| self.number("series_at", *k as f64));
            }
        }
        for step in &steps.profiles_at {
            self.number("profile_at", *step as f64);
        }
    }

    fn following(&mut self, following: &Following) {
        self.text("control", following.control.name());
        self.numbers("bounds", &[following.bounds.0, following.bounds.1]);
        self.number("longest_step", following.longest_step);
        self.number("most_points", following.most_points as f64);
        self.number("stability", f64::from(u8::from(following.with_stability)));
        self.numbers("roots_at", &following.roots_at);
        if let Some(second) = &following.second {
            self.text("second", second.control.name());
            self.numbers("second_bounds", &[second.bounds.0, second.bounds.1]);
            self.number("fold", second.fold as f64);
        }
    }

    fn calibrating(&mut self, what: &Calibrating) {
        for unknown in &what.unknowns {
            self.text("unknown", unknown.control.name());
            self.numbers("unknown", &[unknown.smallest, unknown.largest]);
        }
        for observation in &what.observations {
            self.text("observation", observation.observed.name());
            observation.observed.x_m().into_iter().for_each(|x_m| self.number("x_m", x_m));
            observation.observed.y_m().into_iter().for_each(|y_m| self.number("y_m", y_m));
            self.numbers("observation", &[observation.value, observation.standard_error]);
        }
        self.whole("starts", what.fit.starts as u64);
        self.whole("starts' seed", what.fit.seed);
        if let Some(plan) = &what.mcmc {
            for (tag, number) in [
                ("walkers", plan.walkers),
                ("steps", plan.steps),
                ("burn_in", plan.burn_in),
                ("thin", plan.thinning),
            ] {
                self.whole(tag, number as u64);
            }
            self.whole("mcmc's seed", plan.seed);
        }
    }

    fn whole(&mut self, tag: &str, number: u64) {
        self.text(tag, &number.to_string());
    }

    fn digits(&self) -> String {
        blake3::hash(&self.bytes).to_hex()[..ID_DIGITS].to_owned()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn id(document: &str) -> String {
        Document::parse(document).and_then(Document::into_run).expect("a run").id()
    }

    /// Ids are kept for ever: whoever changes one doubles every archive.
    #[test]
    fn ids_stay_what_they_are() {
        for (document, expected) in [
            (r#"{"regime": "steady"}"#, "feb5d38ccf697ace9703df474f0d340a"),
            (
                r#"{"regime": "steady", "parameters": {"b": 12345.678, "water_drag_n_per_m": -0.0},
                    "options": {"upstream_closure": "no_stretching", "grid_error": true}}"#,
                "460ac2fdf5beef3e7a962025549828bc",
            ),
            (
                r#"{"regime": "quasi_static", "volume_m3": 1e10}"#,
                "0d748fcc3a74630f5164026ef89078cb",
            ),
            (
                r#"{"regime": "diagnostic", "start": {"length_m": 10000, "thickness_0_m": 75},
                    "melt_shape": {"chi": [0, 1], "factor": [2, 1]}}"#,
                "a01872240b2400f31a7fcbeab8486b7f",
            ),
            (
                r#"{"regime": "transient", "start": {"run": "0123456789abcdef"},
                    "fjord": {"x_m": [0, 1e5], "width_m": [4000, 4100], "beyond": "constant"},
                    "forcing": {"mu_s": {"table": {"time_a": [0, 1], "value": [0.3, 0.2]}}},
                    "calving_law": "steady_feedback", "options": {"lagged": true},
                    "time": {"duration_a": 1, "fixed_dt_a": 0.01, "output_every_a": 0.1,
                             "profiles_at_a": [0.5, 1]}}"#,
                "88ac7173d855be275688c22c640271ab",
            ),
            (
                r#"{"regime": "transient", "melt_shape": "linear",
                    "time": {"duration_a": 1, "tolerance": 1e-3, "profiles_at_a": [0.3]}}"#,
                "d352861deb5dca16bf4072b18b904bc7",
            ),
            (
                r#"{"regime": "branch", "calving_law": {"rate_m_per_a": 7000},
                    "branch": {"control": "mu_s", "from": 0.2, "to": 0.4, "roots_at": [0.35, 0.3]}}"#,
                "2547d6db5d6e9d81abc4d100edcaf50b",
            ),
            (
                r#"{"regime": "calibration", "calibration": {"parameters": {"mu_s": [0.1, 0.6]}, "starts": 2,
                    "mcmc": {"walkers": 8, "steps": 40}, "observations": [
                        {"quantity": "thickness_m", "x_m": 100, "value": 90, "standard_error": 2},
                        {"quantity": "length_m", "value": 11000, "standard_error": 100}]}}"#,
                "8decd94f9ad6d15ba07c0895242f4ac3",
            ),
            (
                r#"{"regime": "fold_curve", "fold_curve": {"control": "melt_rate_m_per_day", "from": 0.1,
                    "to": 0.7, "second": "width_m", "second_from": 3e3, "second_to": 5e3}}"#,
                "2e641118c0ac9c623ffd019ae342e31c",
            ),
        ] {
            assert_eq!(id(document), expected, "{document}");
        }
    }
}
