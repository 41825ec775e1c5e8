//! What swings in a transient: parameters with a course that recurs, when each is highest and lowest, and what was
//! in force when.

use super::document::Regime;
use super::parameters;
use super::run::RunSpec;
use melange_solver::forcing::Course;

/// A parameter that swings.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Swing {
    /// Its name.
    pub parameter: &'static str,
    /// From swing to swing, a.
    pub period_a: f64,
    /// When it is highest, but for whole periods, a; none where it stays highest from pulse to pulse.
    pub high_a: Option<f64>,
    /// When it is lowest, but for whole periods, a; none where it stays lowest from pulse to pulse.
    pub low_a: Option<f64>,
}

impl Swing {
    fn of(parameter: &'static str, course: &Course) -> Option<Self> {
        // How far it goes to one side and when, and when it is farthest on the other side.
        let (period_a, height, middle_a, other_a) = match *course {
            Course::Sinusoid { amplitude, period_a, phase_a, .. } => {
                let quarter = |k: f64| phase_a + 0.25 * k * period_a;
                (period_a, amplitude, quarter(1.0), Some(quarter(3.0)))
            }
            Course::Pulse { base, peak, period_a, width_a, phase_a } => {
                // A season that takes the whole period touches its base for a moment only.
                let base_a = (width_a >= period_a).then_some(phase_a);
                (period_a, peak - base, phase_a + 0.5 * width_a, base_a)
            }
            Course::Ramp { .. } | Course::Table(_) => return None,
        };
        let mut extremes_a = (Some(middle_a), other_a);
        if height < 0.0 {
            extremes_a = (other_a, Some(middle_a));
        }
        let (high_a, low_a) = extremes_a;
        (height != 0.0).then_some(Self { parameter, period_a, high_a, low_a })
    }
}

impl RunSpec {
    /// What swings, in the order of the document.
    pub fn swings(&self) -> Vec<Swing> {
        let forcing = &self.shared.forcing;
        let swing = |name| Swing::of(name, forcing.course(name)?);
        forcing.names().filter_map(swing).collect()
    }

    /// Whether the run is one in time.
    pub fn is_transient(&self) -> bool {
        self.shared.regime == Regime::Transient
    }

    /// A forced parameter as it was in force in the state of a time.
    pub fn forced(&self, parameter: &str, time_a: f64) -> Option<f64> {
        let steps = self.shared.steps.as_ref()?;
        let forced_a = steps.forced_at_a(time_a, self.shared.is_lagged);
        let in_force = self.shared.forcing.at(self.parameters(), forced_a);
        parameters::info(parameter).map(|info| (info.get)(&in_force))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::domain::document::Document;

    fn run(forcing: &str, time: &str) -> RunSpec {
        let text = format!(
            r#"{{"regime": "transient", "forcing": {{"melt_rate_m_per_day": {forcing}}}, "time": {time}}}"#
        );
        Document::parse(&text).and_then(Document::into_run).expect("a run")
    }

    #[test]
    fn highs_and_lows_are_where_the_course_is_highest_and_lowest() {
        let time = r#"{"duration_a": 4}"#;
        let (both, only_high, only_low) = ((true, true), (true, false), (false, true));
        for (forcing, has) in [
            (
                r#"{"sinusoid": {"mean": 0.7, "amplitude": 0.2, "period_a": 2, "phase_a": 0.3}}"#,
                both,
            ),
            (r#"{"sinusoid": {"mean": 0.7, "amplitude": -0.2, "period_a": 1}}"#, both),
            // Between pulses nothing happens, and no time there is that of an extreme.
            (
                r#"{"pulse": {"base": 0.2, "peak": 0.8, "period_a": 1, "width_a": 0.4, "phase_a": 0.1}}"#,
                only_high,
            ),
            (
                r#"{"pulse": {"base": 0.8, "peak": 0.2, "period_a": 1, "width_a": 0.7, "phase_a": -2}}"#,
                only_low,
            ),
            (
                r#"{"pulse": {"base": 0.2, "peak": 0.8, "period_a": 2, "width_a": 2, "phase_a": 0.1}}"#,
                both,
            ),
        ] {
            let run = run(forcing, time);
            let [swing] = run.swings()[..] else { panic!("{forcing}: it swings") };
            let at = |t: f64| run.forced("melt_rate_m_per_day", t).expect("it is forced");
            let course = run.shared.forcing.course("melt_rate_m_per_day").expect("a course");
            let (low, high) = course.extremes();
            assert_eq!(
                (swing.high_a.is_some(), swing.low_a.is_some()),
                has,
                "{forcing}: {swing:?}"
            );
            for (time_a, extreme) in [(swing.high_a, high), (swing.low_a, low)] {
                let off = time_a.map_or(0.0, |t| at(t) - extreme);
                assert!(off.abs() < 1e-12, "{forcing}: {swing:?}");
            }
        }
        for forcing in [
            r#"{"sinusoid": {"mean": 0.7, "amplitude": 0, "period_a": 2}}"#,
            r#"{"ramp": {"from": 0.6, "to": 0.7, "start_a": 0, "end_a": 1}}"#,
            r#"{"table": {"time_a": [0, 1], "value": [0.6, 0.7]}}"#,
        ] {
            assert_eq!(run(forcing, time).swings(), [], "{forcing}");
        }
    }

    /// The forcing of a lagged step is that of its start.
    #[test]
    fn what_is_in_force_hangs_on_how_steps_are_taken() {
        let forcing = r#"{"ramp": {"from": 0.5, "to": 1, "start_a": 0, "end_a": 1}}"#;
        let at = |time: &str, t| run(forcing, time).forced("melt_rate_m_per_day", t);
        assert_eq!(at(r#"{"duration_a": 1}"#, 0.5), Some(0.75));
        assert_eq!(at(r#"{"duration_a": 1, "fixed_dt_a": 0.125}"#, 0.5), Some(0.75));
        let mut lagged = run(forcing, r#"{"duration_a": 1, "fixed_dt_a": 0.125}"#);
        let mut shared = lagged.shared.as_ref().clone();
        shared.is_lagged = true;
        lagged.shared = shared.into();
        assert_eq!(lagged.forced("melt_rate_m_per_day", 0.5), Some(0.6875));
        assert_eq!(lagged.forced("melt_rate_m_per_day", 0.0), Some(0.5));
        // Within a step that broke off.
        assert_eq!(lagged.forced("melt_rate_m_per_day", 0.55), Some(0.75));
    }
}
