//! The runs that the figures are drawn from, as documents of sweeps: the settings of the claims' own
//! experiments. Knows nothing of how sweeps are solved and stored.

use super::case::Changes;
use super::season::{self, Swing};
use super::{geometry, rest, rheology, seasons};
use melange_solver::params::{self, ParameterError, Parameters};
use melange_solver::physics::closure::UpstreamClosure;
use melange_solver::state::State;
use melange_solver::{Model, force};
use serde_json::{Map, Value, json};

/// A sweep of the paper's figures.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Experiment {
    /// Fig. 2: the steady base case.
    Steady,
    /// Fig. 2: the same with calving and melt turned off, by time.
    Relaxation,
    /// Fig. 2: where that leads to.
    Limit,
    /// Fig. 3: the base case, then the rheology's parameters, one at a time.
    Rheology,
    /// Fig. 4: small, medium and large glacier.
    Glaciers,
    /// Fig. 5: melt rates.
    Melts,
    /// Fig. 6a, b: widths.
    Widths,
    /// Fig. 6c, d: gradients of the width.
    Gradients,
    /// Fig. 7a, b: melt swings; one for each mean, largest mélange first.
    MeltSeason(usize),
    /// Fig. 7c, d: calving swings, at each melt rate.
    CalvingSeasons,
    /// Fig. 7a, b: melt swings, and calving follows the force.
    CoupledSeason,
}

/// A run as it comes back from the archive.
#[derive(Debug, Clone, PartialEq)]
pub struct Solved {
    /// Its parameters; what is forced has its value without forcing.
    pub parameters: Parameters,
    /// Its last state.
    pub state: State,
    /// The states stored on the way, with their times in a.
    pub states: Vec<(f64, State)>,
    /// Its time series.
    pub series: Vec<Instant>,
}

/// A row of a time series.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Instant {
    /// t, a.
    pub time_a: f64,
    /// Melt rate in force, m d⁻¹.
    pub melt_m_per_day: f64,
    /// Calving rate in force, m a⁻¹.
    pub calving_m_per_a: f64,
    /// H₀, m.
    pub thickness_0_m: f64,
    /// F/W, N m⁻¹.
    pub force_n_per_m: f64,
}

/// The tag of all these sweeps.
pub const TAG: &str = "reproduction";

/// The sweeps that depend on no other one's results, as documents.
pub fn documents() -> Vec<(Experiment, Value)> {
    let mut all = vec![
        (Experiment::Steady, steady("Fig. 2: steady state", &["fig2"], &[])),
        (Experiment::Relaxation, relaxation()),
        (Experiment::Rheology, {
            let mut cases = vec![("base case".to_owned(), Changes::new())];
            cases.extend(rheology::one_at_a_time());
            steady("Fig. 3: rheology, one parameter at a time", &["fig3"], &cases)
        }),
        (
            Experiment::Glaciers,
            steady("Fig. 4: glaciers of three sizes", &["fig4"], &geometry::glaciers()),
        ),
        (
            Experiment::Melts,
            steady("Fig. 5: melt rates", &["fig5", "fig8"], &geometry::melt_rates()),
        ),
        (Experiment::Widths, steady("Fig. 6a, b: widths", &["fig6"], &geometry::widths())),
        (
            Experiment::Gradients,
            steady("Fig. 6c, d: gradients of the width", &["fig6"], &geometry::gradients()),
        ),
    ];
    let middle = seasons::MELT_M_PER_DAY[1];
    for (i, melt) in seasons::MELT_M_PER_DAY.iter().enumerate() {
        let name = format!("Fig. 7a, b: melt through the year, {melt} m/d on average");
        all.push((Experiment::MeltSeason(i), year(&name, Swing::Melt, &[*melt])));
    }
    let name = "Fig. 7c, d: calving through the year";
    let calving = year(name, Swing::Calving, &seasons::MELT_M_PER_DAY);
    all.push((Experiment::CalvingSeasons, calving));
    let name = "Fig. 7a, b: melt through the year, calving follows the force";
    all.push((Experiment::CoupledSeason, year(name, Swing::Coupled, &[middle])));
    all
}

/// Where the relaxation leads to: the limit with the volume that is left at its end.
pub fn limit(relaxed: &Solved) -> Result<(Experiment, Value), ParameterError> {
    let model = Model::new(relaxed.parameters, UpstreamClosure::Published)?;
    let volume_m3 = force::volume_m3(&model, &relaxed.state, 0.0);
    let mut document = head("Fig. 2: quasi-static limit", &["fig2"], "quasi_static");
    document.insert("volume_m3".into(), json!(volume_m3));
    Ok((Experiment::Limit, Value::Object(document)))
}

fn head(name: &str, tags: &[&str], regime: &str) -> Map<String, Value> {
    let tags = [&[TAG], tags].concat();
    let members = [("name", json!(name)), ("tags", json!(tags)), ("regime", json!(regime))];
    members.map(|(name, value)| (name.to_owned(), value)).into_iter().collect()
}

/// Steady states of cases: an axis if they differ in one parameter, else a table.
fn steady(name: &str, tags: &[&str], cases: &[(String, Changes)]) -> Value {
    let mut document = head(name, tags, "steady");
    let mut columns: Vec<&str> = Vec::new();
    for (parameter, _) in cases.iter().flat_map(|(_, changes)| changes) {
        if !columns.contains(parameter) {
            columns.push(parameter);
        }
    }
    let value = |changes: &Changes, parameter: &str| {
        let changed = changes.iter().find(|(name, _)| *name == parameter).map(|(_, v)| *v);
        changed.unwrap_or_else(|| params::info(parameter).expect("a parameter's name").default)
    };
    match columns[..] {
        [] => {}
        [parameter] => {
            let values: Vec<f64> = cases.iter().map(|(_, c)| value(c, parameter)).collect();
            let axis = json!({ "parameter": parameter, "values": values });
            document.insert("axes".into(), json!([axis]));
        }
        _ => {
            let row = |(_, c): &(String, Changes)| -> Vec<f64> {
                columns.iter().map(|parameter| value(c, parameter)).collect()
            };
            let rows: Vec<Vec<f64>> = cases.iter().map(row).collect();
            document.insert("table".into(), json!({ "columns": columns, "rows": rows }));
        }
    }
    Value::Object(document)
}

/// What becomes of the steady state without calving and melt.
fn relaxation() -> Value {
    let off = json!({ "ramp": { "from": 0.0, "to": 0.0, "start_a": 0.0, "end_a": 1.0 } });
    let mut document =
        head("Fig. 2: relaxation, calving and melt turned off", &["fig2"], "transient");
    document.insert("start".into(), json!("steady"));
    let forcing = json!({ "melt_rate_m_per_day": off, "calving_rate_m_per_a": off });
    document.insert("forcing".into(), forcing);
    let time = json!({
        "duration_a": rest::DURATION_A,
        "tolerance": rest::TOLERANCE,
        "profiles_at_a": rest::KEPT_A,
    });
    document.insert("time".into(), time);
    Value::Object(document)
}

/// Seasons from the steady states of some melt rates, stepped as the published scripts do it.
fn year(name: &str, swing: Swing, melts_m_per_day: &[f64]) -> Value {
    let mut document = head(name, &["fig7", "fig8"], "transient");
    document.insert("start".into(), json!("steady"));
    let calving = Parameters::default().calving_rate_m_per_a;
    let (parameter, mean, amplitude) = season::swung(swing, melts_m_per_day[0], calving);
    let sinusoid = json!({ "mean": mean, "amplitude": amplitude, "period_a": season::PERIOD_A });
    document.insert("forcing".into(), json!({ parameter: { "sinusoid": sinusoid } }));
    if swing == Swing::Coupled {
        document.insert("calving_law".into(), json!("steady_feedback"));
    }
    let time = json!({ "duration_a": season::DURATION_A, "fixed_dt_a": season::STEP_A });
    document.insert("time".into(), time);
    document.insert("options".into(), json!({ "lagged": true }));
    let axis = json!({ "parameter": "melt_rate_m_per_day", "values": melts_m_per_day });
    document.insert("axes".into(), json!([axis]));
    Value::Object(document)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_sweep_has_its_name_its_tags_and_the_settings_of_the_claims() {
        let all = documents();
        assert_eq!(all.len(), 12);
        for (experiment, document) in &all {
            assert!(document["name"].as_str().is_some_and(|name| name.starts_with("Fig. ")));
            assert_eq!(document["tags"][0], TAG, "{experiment:?}");
        }
        let of = |wanted| &all.iter().find(|(e, _)| *e == wanted).expect("it is there").1;
        assert_eq!(
            of(Experiment::Melts)["axes"][0]["values"],
            json!([0.5, 0.6, 0.7, 0.8, 0.9, 1.0])
        );
        let rheology = of(Experiment::Rheology);
        assert_eq!(rheology["table"]["columns"], json!(["d_m", "b", "A", "mu_s"]));
        assert_eq!(rheology["table"]["rows"][0], json!([25.0, 1e4, 0.5, 0.3]));
        assert_eq!(rheology["table"]["rows"][4], json!([25.0, 1e4, 0.5, 0.2]));
        let calving = of(Experiment::CalvingSeasons);
        let sinusoid = &calving["forcing"]["calving_rate_m_per_a"]["sinusoid"];
        assert_eq!(sinusoid, &json!({ "mean": 6000.0, "amplitude": 600.0, "period_a": 1.0 }));
        assert_eq!(calving["options"]["lagged"], true);
    }
}
