//! Seasons over REST: how a transient's number answers to a parameter that swings.

use super::Service;
use super::error::Problem;
use super::extract::{Asked, Place};
use super::states::run_of;
use crate::analysis::season::{SeasonRange, Sense, Track, correlation};
use crate::archive::read;
use crate::domain::outcome::{SERIES, Series};
use crate::domain::refusal::Refusal;
use crate::domain::run::RunSpec;
use crate::domain::swing::Swing;
use axum::Json;
use axum::extract::State;
use serde::{Deserialize, Serialize};
use utoipa::{IntoParams, ToSchema};

/// The column of times.
const TIME: &str = "time_a";
/// Rows that a period needs for its extremes to be found.
const LEAST_ROWS: usize = 8;

/// Which season.
#[derive(Debug, Deserialize, IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
pub struct SeasonQuery {
    /// A parameter that swings: forced by a sinusoid or by pulses; the first one that does if not given.
    forcing: Option<String>,
    /// A column of the series; `force_n_per_m` if not given.
    response: Option<String>,
}

/// How a number answers to a parameter that swings: ranges and correlation over the last whole period of the series,
/// lags behind the last extremes of the parameter that half a period follows.
#[derive(Debug, PartialEq, Serialize, ToSchema)]
pub struct Season {
    /// The parameter.
    forcing: String,
    /// The number.
    response: String,
    /// From swing to swing, a.
    period_a: f64,
    /// Where the last whole period begins, a.
    from_a: f64,
    /// Where it ends, a: the end of the series.
    to_a: f64,
    /// Other parameters that swing in this run: what the number does is the answer to all of them together.
    also_swings: Vec<String>,
    /// Mean of the two lags, or the one that there is; null if there is none.
    lag_a: Option<f64>,
    /// Lag behind the last high that half a period follows; null if there is no such high, as where the parameter
    /// stays highest from pulse to pulse, or if the response does not turn then.
    lag_after_high_a: Option<f64>,
    /// When that high was, a: it may lie before the last whole period; null where the lag is.
    high_a: Option<f64>,
    /// The same of the last low.
    lag_after_low_a: Option<f64>,
    /// When that low was, a.
    low_a: Option<f64>,
    /// What the lags are, and why one is null.
    lag_meaning: String,
    /// The parameter as it was in force.
    forcing_range: SeasonRange,
    response_range: SeasonRange,
    /// Half of largest less least response.
    amplitude: f64,
    /// The amplitude by the mean; null if that is 0.
    relative_amplitude: Option<f64>,
    /// Correlation over time of parameter and number; null if the number does not vary.
    correlation: Option<f64>,
}

/// How a transient's number answers to a parameter that swings: lags, range, correlation, and what else swings. 409
/// where nothing swings, or the series is shorter than one period or has fewer than 8 rows in the last one.
#[utoipa::path(
    get, path = "/runs/{id}/season", params(("id" = String, Path,), SeasonQuery),
    responses(
        (status = 200, body = Season), (status = 400, body = Problem), (status = 404, body = Problem),
        (status = 409, body = Problem), (status = 422, body = Problem),
    )
)]
pub async fn season(
    State(service): State<Service>,
    Place(id): Place<String>,
    Asked(asked): Asked<SeasonQuery>,
) -> Result<Json<Season>, Problem> {
    let response = asked.response.unwrap_or_else(|| "force_n_per_m".to_owned());
    let columns = || SERIES.iter().filter(|info| info.name != TIME);
    let Some(column) = columns().find(|info| info.name == response) else {
        let names: Vec<&str> = columns().map(|info| info.name).collect();
        return Err(Refusal::value("response", response, names.join(", ")).into());
    };
    let outcome = read::stored(&service.store, &id).await?;
    let mut outcome = outcome.ok_or_else(|| Problem::not_found("run", &id))?;
    let run = run_of(&service.store, &id, &outcome).await?;
    if !run.is_transient() {
        let why = format!("only transients have seasons, and this run is {}", outcome.regime);
        return Err(Problem::conflict(why));
    }
    let swing = which(&run, asked.forcing.as_deref())?;
    let series = outcome.series.take().unwrap_or_default();
    let told = tokio::task::spawn_blocking(move || {
        let response = (column.get)(&series).clone();
        of(&run, &swing, &series, column.name, response)
    });
    Ok(Json(told.await??))
}

/// The swing that is asked about.
fn which(run: &RunSpec, wanted: Option<&str>) -> Result<Swing, Problem> {
    let swings = run.swings();
    let Some(first) = swings.first() else {
        let why = "nothing swings in this run: no parameter is forced by a sinusoid or by pulses";
        return Err(Problem::conflict(why));
    };
    let Some(wanted) = wanted else { return Ok(*first) };
    swings.iter().find(|swing| swing.parameter == wanted).copied().ok_or_else(|| {
        let names: Vec<&str> = swings.iter().map(|swing| swing.parameter).collect();
        Refusal::value("forcing", wanted, names.join(", ")).into()
    })
}

fn of(
    run: &RunSpec,
    swing: &Swing,
    series: &Series,
    name: &str,
    response: Vec<f64>,
) -> Result<Season, Problem> {
    let period = swing.period_a;
    if response.iter().any(|value| !value.is_finite()) {
        let why = format!("the run's series has no {name} at some of its times");
        return Err(Problem::conflict(why));
    }
    let in_force = |t: &f64| run.forced(swing.parameter, *t).unwrap_or(f64::NAN);
    let forcing: Vec<f64> = series.time_a.iter().map(in_force).collect();
    let track = |value| Track { time: series.time_a.clone(), value };
    let (forcing, response) = (track(forcing), track(response));
    let (Some(last_forcing), Some(last)) = (forcing.last(period), response.last(period)) else {
        let covered = match series.time_a[..] {
            [first, .., end] => end - first,
            _ => 0.0,
        };
        return Err(Problem::conflict(format!(
            "the run's series covers {covered} a, which is less than one whole period of {period} a"
        )));
    };
    if last.time.len() <= LEAST_ROWS {
        return Err(Problem::conflict(format!(
            "the run's series has {} rows in its last period, and {LEAST_ROWS} are needed to tell when it turns",
            last.time.len() - 1
        )));
    }
    let (Some(forcing_range), Some(response_range)) = (last_forcing.range(), last.range()) else {
        return Err(Problem::conflict("the times of the run's series do not go on"));
    };
    let sense = last_forcing.sense_of(&last, period);
    let lags = sense.map(|sense| {
        let lag = |at, sign| Lag::of(&response, at, period, sign);
        [lag(swing.high_a, sense.sign()), lag(swing.low_a, -sense.sign())]
    });
    let lag_meaning = meaning(swing, name, sense.zip(lags.as_ref()));
    let [after_high, after_low] = lags.map_or([None; 2], |lags| lags.map(Result::ok));
    let lag_a = match (after_high, after_low) {
        (Some(high), Some(low)) => Some(0.5 * (high.lag_a + low.lag_a)),
        (one, other) => one.or(other).map(|lag| lag.lag_a),
    };
    let others = run.swings().into_iter().map(|other| other.parameter);
    let amplitude = 0.5 * (response_range.max - response_range.min);
    Ok(Season {
        forcing: swing.parameter.to_owned(),
        response: name.to_owned(),
        period_a: period,
        from_a: last.time[0],
        to_a: last.time[last.time.len() - 1],
        also_swings: others.filter(|o| *o != swing.parameter).map(str::to_owned).collect(),
        lag_a,
        lag_after_high_a: after_high.map(|lag| lag.lag_a),
        high_a: after_high.map(|lag| lag.forced_a),
        lag_after_low_a: after_low.map(|lag| lag.lag_a),
        low_a: after_low.map(|lag| lag.forced_a),
        lag_meaning,
        forcing_range,
        response_range,
        amplitude,
        relative_amplitude: Some(amplitude / response_range.mean).filter(|share| share.is_finite()),
        correlation: correlation(&last.weights(), &last_forcing.value, &last.value),
    })
}

/// How long after an extreme of the parameter the response has its own.
#[derive(Debug, Clone, Copy)]
struct Lag {
    forced_a: f64,
    lag_a: f64,
}

/// Why there is no lag behind an extreme of the parameter.
#[derive(Debug, Clone, Copy)]
enum NoLag {
    /// The parameter stays there from pulse to pulse.
    Flat,
    /// Too little of the series is around it.
    Short,
    /// The response has no extreme around that time, a.
    NoTurn(f64),
}

impl Lag {
    /// Behind the last of the times `at` + whole periods around which there is enough of the series.
    fn of(response: &Track, at: Option<f64>, period: f64, sign: f64) -> Result<Self, NoLag> {
        let at = at.ok_or(NoLag::Flat)?;
        let forced_a = response.last_forced(at, period).ok_or(NoLag::Short)?;
        let extreme_a = response.extreme(forced_a, period, sign);
        Ok(Self { forced_a, lag_a: extreme_a.ok_or(NoLag::NoTurn(forced_a))? - forced_a })
    }
}

impl NoLag {
    fn sentence(self, forcing: &str, response: &str, extreme: &str) -> String {
        let why = match self {
            Self::Flat => format!("{forcing} stays there from pulse to pulse"),
            Self::Short => "the series has none with a quarter of a period before it and half a period behind it"
                .to_owned(),
            Self::NoTurn(time_a) => format!("{response} does not turn around the last one, {time_a:.3} a"),
        };
        format!("no lag behind {forcing} at its {extreme}, since {why}")
    }
}

/// What the lags behind high and low are, and why there is none.
fn meaning(
    swing: &Swing,
    response: &str,
    told: Option<(Sense, &[Result<Lag, NoLag>; 2])>,
) -> String {
    let forcing = swing.parameter;
    let Some((sense, lags)) = told else {
        return format!("there is no lag: {response} does not swing in the last period");
    };
    let extremes = match sense {
        Sense::With => [("highest", "highest"), ("lowest", "lowest")],
        Sense::Against => [("highest", "lowest"), ("lowest", "highest")],
    };
    let (mut counted, mut missing) = (Vec::new(), Vec::new());
    for ((of_forcing, of_response), lag) in extremes.into_iter().zip(lags) {
        match lag {
            Ok(_) => counted.push(format!(
                "from {forcing} at its {of_forcing} to {response} at its {of_response}"
            )),
            Err(why) => missing.push(why.sentence(forcing, response, of_forcing)),
        }
    }
    if counted.is_empty() {
        return format!("there is no lag: {}", missing.join("; "));
    }
    let missing: String = missing.iter().map(|why| format!("; {why}")).collect();
    format!(
        "time {}, each time the last one with half a period of the series behind it, which may lie before the last \
         whole period; by the parabola through the extreme row and its neighbours; whether the one goes with the other \
         or against it is taken such that the swing as a whole lags by -1/12 to 5/12 of the period{missing}",
        counted.join(", and ")
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::domain::document::Document;
    use serde_json::{Value, json};

    const MELT: &str = "melt_rate_m_per_day";

    fn run(forcing: Value) -> RunSpec {
        let document =
            json!({"regime": "transient", "forcing": forcing, "time": {"duration_a": 3}});
        Document::parse(&document.to_string()).and_then(Document::into_run).expect("a run")
    }

    /// Of a run with a row every hundredth of a year, up to a time, and a number over time.
    fn told(run: &RunSpec, end_a: f64, response: impl Fn(f64) -> f64) -> Season {
        let rows = (end_a * 100.0).round() as usize;
        let time_a: Vec<f64> = (0..=rows).map(|row| row as f64 / 100.0).collect();
        let response = time_a.iter().map(|t| response(*t)).collect();
        let series = Series { time_a, ..Series::default() };
        let swing = which(run, Some(MELT)).expect("it swings");
        of(run, &swing, &series, "force_n_per_m", response).expect("a season")
    }

    #[test]
    fn a_forcing_lags_behind_itself_by_nothing() {
        let sinusoid =
            json!({"sinusoid": {"mean": 0.7, "amplitude": 0.2, "period_a": 1, "phase_a": 0.1}});
        let turned = json!({"sinusoid": {"mean": 0.7, "amplitude": -0.2, "period_a": 1}});
        let pulse = |base: f64, peak: f64, width_a: f64| json!({"pulse": {"base": base, "peak": peak, "period_a": 1, "width_a": width_a, "phase_a": 0.1}});
        for (course, behind_high, behind_low) in [
            (sinusoid, true, true),
            (turned, true, true),
            (pulse(0.2, 0.8, 0.4), true, false),
            (pulse(0.2, 0.8, 0.7), true, false),
            (pulse(0.8, 0.2, 0.4), false, true),
            (pulse(0.2, 0.8, 1.0), true, true),
        ] {
            let run = run(json!({ MELT: course.clone() }));
            let told = told(&run, 3.0, |t| run.forced(MELT, t).expect("it is forced"));
            let has = (told.lag_after_high_a.is_some(), told.lag_after_low_a.is_some());
            assert_eq!(has, (behind_high, behind_low), "{course}: {told:?}");
            for lag in
                [told.lag_a, told.lag_after_high_a, told.lag_after_low_a].into_iter().flatten()
            {
                assert!(lag.abs() < 1e-9, "{course}: {told:?}");
            }
            assert!(told.lag_a.is_some(), "{course}: {told:?}");
            let is_said = told.lag_meaning.contains("stays there from pulse to pulse");
            assert_eq!(is_said, !(behind_high && behind_low), "{course}: {told:?}");
        }
    }

    /// Half a period has to follow, so that one of the extremes may lie before the last period.
    #[test]
    fn lags_tell_what_they_are_counted_from() {
        let run = run(json!({MELT: {"sinusoid": {"mean": 0.7, "amplitude": 0.2, "period_a": 1}}}));
        let response = |t: f64| -run.forced(MELT, t - 0.2).expect("it is forced");
        for (end_a, high, low) in [(3.5, 2.25, 2.75), (3.0, 2.25, 1.75), (2.5, 1.25, 1.75)] {
            let told = told(&run, end_a, response);
            assert_eq!((told.from_a, told.to_a), (end_a - 1.0, end_a));
            let is_at =
                |at: Option<f64>, expected: f64| at.is_some_and(|at| (at - expected).abs() < 1e-9);
            assert!(is_at(told.high_a, high) && is_at(told.low_a, low), "{told:?}");
            assert!(is_at(told.lag_a, 0.2), "{told:?}");
            assert!(told.lag_meaning.contains("may lie before the last whole period"), "{told:?}");
        }
    }

    #[test]
    fn what_else_swings_is_named_and_a_lag_that_is_not_there_explained() {
        let sinusoid =
            |mean: f64| json!({"sinusoid": {"mean": mean, "amplitude": 0.1, "period_a": 1}});
        let alone = run(json!({ MELT: sinusoid(0.7) }));
        let swung = |t: f64| alone.forced(MELT, t).expect("it is forced");
        assert_eq!(told(&alone, 3.0, swung).also_swings, [""; 0]);
        let ramp = json!({"ramp": {"from": 0.6, "to": 0.7, "start_a": 0, "end_a": 1}});
        let two =
            run(json!({MELT: sinusoid(0.7), "calving_rate_m_per_a": sinusoid(6e3), "d_m": ramp}));
        assert_eq!(told(&two, 3.0, swung).also_swings, ["calving_rate_m_per_a"]);

        let none =
            |season: &Season| (season.lag_a, season.high_a, season.low_a) == (None, None, None);
        let still = told(&alone, 3.0, |_| 4.0);
        assert!(none(&still) && still.lag_meaning.contains("does not swing"), "{still:?}");
        let steep = told(&alone, 3.0, |t| 50.0 * t + swung(t));
        assert!(none(&steep) && steep.lag_meaning.starts_with("there is no lag: "), "{steep:?}");
        assert!(
            steep.lag_meaning.contains("does not turn around the last one, 2.250 a"),
            "{steep:?}"
        );
        let short = told(&alone, 1.0, swung);
        assert!(short.lag_after_high_a.is_some() && short.lag_after_low_a.is_none(), "{short:?}");
        assert_eq!(short.lag_a, short.lag_after_high_a);
        assert!(short.lag_meaning.contains("half a period behind it"), "{short:?}");
    }
}
