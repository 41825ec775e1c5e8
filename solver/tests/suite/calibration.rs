//! Calibration: slopes against differences of whole solves, recovery of known parameters, coverage of the
//! intervals, bounds, and what is said where parameters cannot be told apart.

use crate::{assert_close, model, steady};
use melange_solver::calibration::descent::{Bound, Ending};
use melange_solver::calibration::fit::{Fit, Outcome, Plan, fit};
use melange_solver::calibration::observations::{Observation, Observed, slopes_by_ln};
use melange_solver::calibration::{Calibration, CalibrationError, Unknown};
use melange_solver::control::{Control, Setting};
use melange_solver::sensitivity::{Linearised, Quantity};
use melange_solver::state::State;
use rand::rngs::ChaCha8Rng;
use rand::{Rng, SeedableRng};
use std::f64::consts::TAU;
use std::ops::ControlFlow;

const RHEOLOGY: [&str; 4] = ["d_m", "b", "A", "mu_s"];

pub(crate) fn control(name: &str) -> Control {
    Control::named(name).expect("the test names a control")
}

/// Numbers of mean 0 and variance 1.
pub(crate) struct Noise(ChaCha8Rng);

impl Noise {
    pub(crate) fn new(seed: u64) -> Self {
        Self(ChaCha8Rng::seed_from_u64(seed))
    }

    fn next(&mut self) -> f64 {
        let mut u = || ((self.0.next_u64() >> 11) as f64 + 0.5) / (1_u64 << 53) as f64;
        (-2.0 * u().ln()).sqrt() * (TAU * u()).cos()
    }
}

/// A mélange with known parameters, none of them a default.
pub(crate) struct Truth {
    pub(crate) setting: Setting,
    pub(crate) state: State,
}

impl Truth {
    pub(crate) fn new() -> Self {
        let model = model(|p| {
            (p.d_m, p.b, p.A, p.mu_s) = (28.0, 1.3e4, 0.7, 0.26);
            p.n_cells = 20;
        });
        let state = steady(&model).state;
        Self { setting: Setting { model, law: None }, state }
    }

    pub(crate) fn value(&self, name: &str) -> f64 {
        control(name).value(&self.setting)
    }

    /// H at twenty places.
    fn thicknesses(&self) -> Vec<Observed> {
        let x_m = |i: usize| (0.025 + 0.047 * i as f64) * self.state.length_m;
        (0..20).map(|i| Observed::Thickness { x_m: x_m(i) }).collect()
    }

    /// U at the same places.
    fn velocities(&self) -> Vec<Observed> {
        let x_m = self.thicknesses().into_iter().filter_map(Observed::x_m);
        x_m.map(|x_m| Observed::Velocity { x_m }).collect()
    }

    pub(crate) fn profiles(&self) -> Vec<Observed> {
        [self.thicknesses(), self.velocities()].concat()
    }

    /// Profiles, four transects, length and force.
    fn everything(&self) -> Vec<Observed> {
        let mut all = self.profiles();
        for chi in [0.13, 0.37, 0.61, 0.83] {
            let x_m = chi * self.state.length_m;
            all.extend(
                (0..10)
                    .map(|i| Observed::VelocityAcross { x_m, y_m: 110.0 + 185.0 * f64::from(i) }),
            );
        }
        all.extend([Quantity::Length, Quantity::Force].map(Observed::Whole));
        all
    }

    /// Observations with relative standard errors, and with as much noise if there is any.
    pub(crate) fn observe(
        &self,
        observed: &[Observed],
        relative: f64,
        mut noise: Option<&mut Noise>,
    ) -> Vec<Observation> {
        let observation = |observed: &Observed| {
            let exact = observed.prediction(&self.setting, &self.state);
            let standard_error = relative * exact.abs();
            let error = noise.as_mut().map_or(0.0, |noise| noise.next());
            Observation {
                observed: *observed,
                value: exact + standard_error * error,
                standard_error,
            }
        };
        observed.iter().map(observation).collect()
    }

    /// To be found within a factor of four, from starts that are off by a tenth.
    pub(crate) fn calibration(
        &self,
        names: &[&str],
        observations: Vec<Observation>,
    ) -> Calibration {
        let mut setting = self.setting.clone();
        let unknown = |name: &&str| {
            let (control, value) = (control(name), self.value(name));
            control.set(&mut setting, 1.1 * value);
            Unknown { control, smallest: value / 4.0, largest: 4.0 * value }
        };
        let unknowns = names.iter().map(unknown).collect();
        Calibration::new(setting.model, unknowns, observations)
            .expect("the calibration makes sense")
    }
}

pub(crate) fn fitted(calibration: &Calibration, starts: usize) -> Fit {
    let plan = Plan { starts, ..Plan::default() };
    fit(calibration, &plan, &mut |_| ControlFlow::Continue(())).expect("there is a fit")
}

#[test]
fn slopes_are_those_of_whole_solves() {
    const STEP_LN: f64 = 1e-5;
    let truth = Truth::new();
    let Truth { setting, state } = &truth;
    let mut observed = truth.everything();
    observed.extend(Quantity::ALL.map(Observed::Whole));
    let x_m = 1.03 * state.length_m;
    observed.extend([
        Observed::Thickness { x_m },
        Observed::Velocity { x_m },
        Observed::VelocityAcross { x_m, y_m: 710.0 },
    ]);
    let observations = truth.observe(&observed, 1.0, None);
    for name in
        [&RHEOLOGY[..], &["melt_rate_m_per_day", "width_m", "calving_flux_m2_per_a"]].concat()
    {
        let control = control(name);
        let mut linearised = Linearised::at(setting, state).expect("the state is regular");
        let tangent = linearised.tangent(control).expect("the state is regular");
        let slopes = slopes_by_ln(&observations, setting, state, control, &tangent);
        let [ahead, behind] = [STEP_LN, -STEP_LN].map(|step: f64| {
            let mut moved = setting.clone();
            control.set(&mut moved, control.value(setting) * step.exp());
            let state = steady(&moved.model).state;
            observed.iter().map(|o| o.prediction(&moved, &state)).collect::<Vec<_>>()
        });
        for (i, slope) in slopes.iter().enumerate() {
            let difference = (ahead[i] - behind[i]) / (2.0 * STEP_LN);
            let scale = difference.abs() + 0.1 * observations[i].value.abs();
            let error = (slope - difference).abs() / scale;
            // Across, the curvature itself has kinks, where a difference's error falls with its step only.
            let is_across = matches!(observed[i], Observed::VelocityAcross { .. });
            let tolerance = if is_across { 1e-5 } else { 1e-6 };
            assert!(error < tolerance, "{:?} by {name}: {slope}, {difference}", observed[i]);
            if let Observed::Whole(quantity) = observed[i] {
                let exact = linearised.sensitivity(quantity).expect("the state is regular");
                let exact = exact.by_control(control, setting, state) * control.value(setting);
                assert_close(&format!("{quantity:?} by {name}"), *slope, exact, 1e-6);
            }
        }
    }
}

#[test]
fn predictions_go_on_beyond_the_end_and_mirror_at_the_centre() {
    let Truth { setting, state } = Truth::new();
    let at = |observed: Observed| observed.prediction(&setting, &state);
    let length_m = state.length_m;
    let across = |x_m: f64, y_m: f64| Observed::VelocityAcross { x_m, y_m };
    let kinds: [&dyn Fn(f64) -> Observed; 3] =
        [&|x_m| Observed::Thickness { x_m }, &|x_m| Observed::Velocity { x_m }, &|x_m| {
            across(x_m, 700.0)
        }];
    for kind in kinds {
        let [before, beyond] = [1.0 - 1e-9, 1.0 + 1e-9].map(|chi| kind(chi * length_m));
        assert!(!before.is_beyond(&state) && beyond.is_beyond(&state));
        assert_close("both sides of the end", at(before), at(beyond), 1e-6);
        let [a, b, c] = [1.1, 1.2, 1.3].map(|chi| at(kind(chi * length_m)));
        assert_close("a straight line beyond", b, 0.5 * (a + c), 1e-12);
    }
    let [end, beyond] = [1.0, 1.1].map(|chi| at(Observed::Thickness { x_m: chi * length_m }));
    assert!(beyond < end - 1.0, "it slopes: {end}, {beyond}");
    assert_close("H₀", at(Observed::Thickness { x_m: 0.0 }), state.thickness_0_m(), 1e-14);
    assert_close("H_L", at(Observed::Thickness { x_m: length_m }), state.thickness_end_m(), 1e-12);
    let x_m = 0.4 * length_m;
    assert_close("the other wall", at(across(x_m, 700.0)), at(across(x_m, 3300.0)), 1e-12);
    assert_eq!(at(across(x_m, 0.0)), 0.0);
    assert!(at(across(x_m, 1900.0)) > at(across(x_m, 300.0)));
}

#[test]
fn what_makes_no_sense_is_refused_by_name() {
    let truth = Truth::new();
    let refusal = |unknowns: &[(&str, f64, f64)], change: &dyn Fn(&mut Observation)| {
        let unknowns = unknowns.iter().map(|(name, smallest, largest)| Unknown {
            control: control(name),
            smallest: *smallest,
            largest: *largest,
        });
        let mut observations = truth.observe(&truth.everything(), 0.01, None);
        change(&mut observations[3]);
        let model = truth.setting.model.clone();
        let refused = Calibration::new(model, unknowns.collect(), observations);
        refused.expect_err("it makes no sense").to_string()
    };
    let b = ("b", 1e3, 1e5);
    let unchanged = |_: &mut Observation| {};
    let cases = [
        (refusal(&[b], &|o| o.value = f64::NAN), "`observations[3].value` = NaN"),
        (refusal(&[b], &|o| o.standard_error = 0.0), "`observations[3].standard_error` = 0 "),
        (
            refusal(&[b], &|o| o.observed = Observed::Thickness { x_m: -1.0 }),
            "`observations[3].x_m` = -1 is out of range: a finite number from 0 m",
        ),
        (
            refusal(&[b], &|o| o.observed = Observed::VelocityAcross { x_m: 5.0, y_m: 4001.0 }),
            "width at x = 5 m, 4000 m",
        ),
        (refusal(&[("b", 0.0, 1e5)], &unchanged), "`unknowns.b.smallest` = 0 "),
        (refusal(&[("b", 1e4, 1e4)], &unchanged), "`unknowns.b.largest` = 10000 "),
        (refusal(&[("b", 2e4, 1e5)], &unchanged), "`unknowns.b` = 13000 is out of range"),
        (refusal(&[b, b], &unchanged), "`b` and `b` cannot be found together"),
        (refusal(&[("rate_m_per_a", 1.0, 2.0)], &unchanged), "only where a calving law"),
        (refusal(&[], &unchanged), "0 parameters cannot be found from 82 observations"),
    ];
    for (message, part) in cases {
        assert!(message.contains(part), "`{message}` does not say `{part}`");
    }
    let named = |name: &str, x_m, y_m| Observed::named(name, x_m, y_m).map_err(|e| e.to_string());
    assert_eq!(named("thickness_m", Some(5.0), None), Ok(Observed::Thickness { x_m: 5.0 }));
    assert_eq!(named("length_m", None, None), Ok(Observed::Whole(Quantity::Length)));
    for (wrong, part) in [
        (named("thickness_m", None, None), "`x_m` is missing"),
        (named("length_m", Some(5.0), None), "`x_m` has no place here"),
        (named("velocity_m_per_a", Some(5.0), Some(5.0)), "`y_m` has no place here"),
        (named("depth", None, None), "known are thickness_m, velocity_m_per_a"),
    ] {
        assert!(wrong.as_ref().is_err_and(|e| e.contains(part)), "{wrong:?}");
    }
}

#[test]
fn parameters_are_recovered_from_exact_and_from_noisy_observations() {
    let truth = Truth::new();
    let exact = truth.observe(&truth.everything(), 0.01, None);
    let found = fitted(&truth.calibration(&RHEOLOGY, exact), 1);
    assert!(found.chi2 < 1e-3, "{}", found.chi2);
    for (estimate, name) in found.estimates.iter().zip(RHEOLOGY) {
        let error = (estimate.value / truth.value(name)).ln().abs();
        let standard_error = estimate.standard_error_ln.expect("it is determined");
        assert!(error < 0.02 * standard_error, "{name}: {estimate:?}");
    }
    assert!(!found.uncertainty.is_poor());

    let noisy = truth.observe(&truth.profiles(), 0.02, Some(&mut Noise::new(5)));
    let found = fitted(&truth.calibration(&["d_m", "mu_s"], noisy), 1);
    assert_eq!((found.ending, found.degrees_of_freedom), (Ending::Converged, 38));
    assert!((20.0..60.0).contains(&found.chi2), "χ² of 38 degrees of freedom: {}", found.chi2);
    for (estimate, name) in found.estimates.iter().zip(["d_m", "mu_s"]) {
        let error = (estimate.value / truth.value(name)).ln().abs();
        let standard_error = estimate.standard_error_ln.expect("it is determined");
        assert!(error < 3.0 * standard_error && standard_error < 0.05, "{name}: {estimate:?}");
    }
}

#[test]
fn intervals_of_95_percent_cover_the_truth() {
    const REPETITIONS: usize = 200;
    let truth = Truth::new();
    let everything = truth.everything();
    let mut noise = Noise::new(3);
    let mut covered = [0; RHEOLOGY.len()];
    let mut chi2 = 0.0;
    for _ in 0..REPETITIONS {
        let observations = truth.observe(&everything, 0.02, Some(&mut noise));
        let found = fitted(&truth.calibration(&RHEOLOGY, observations), 1);
        chi2 += found.chi2 / found.degrees_of_freedom as f64 / REPETITIONS as f64;
        for (k, estimate) in found.estimates.iter().enumerate() {
            let [from, to] = estimate.interval_95.expect("it is determined");
            covered[k] += usize::from((from..to).contains(&truth.value(RHEOLOGY[k])));
        }
    }
    for (count, name) in covered.iter().zip(RHEOLOGY) {
        assert!((182..=196).contains(count), "{name} is covered {count} times in {REPETITIONS}");
    }
    assert!((chi2 - 1.0).abs() < 0.04, "mean reduced χ²: {chi2}");
}

#[test]
fn thickness_alone_does_not_tell_yield_from_b() {
    let truth = Truth::new();
    let names = ["b", "mu_s"];
    let correlation = |observed: &[Observed]| {
        let observations = truth.observe(observed, 0.01, Some(&mut Noise::new(2)));
        let found = fitted(&truth.calibration(&names, observations), 1).uncertainty;
        (found.correlation.as_ref().expect("both are free")[0][1], found)
    };
    let (alone, uncertainty) = correlation(&truth.thicknesses());
    let (with_transects, _) = correlation(&truth.everything());
    assert!(alone < -0.99, "{alone}");
    assert!(with_transects > -0.96, "{with_transects}");
    let weakest = &uncertainty.directions[0];
    assert!(weakest.exponents[0] > 0.9 && weakest.exponents[1] < 0.0, "{weakest:?}");
    assert!(uncertainty.weakest().starts_with("least known is b^0."), "{}", uncertainty.weakest());
    assert!(uncertainty.condition_number() > 1e3);
}

#[test]
fn what_the_observations_do_not_depend_on_is_said_to_be_unknown() {
    // The same number twice tells one combination, and nothing of the other.
    let truth = Truth::new();
    let length = [Observed::Whole(Quantity::Length); 2];
    let observations = truth.observe(&length, 0.01, None);
    let found = fitted(&truth.calibration(&["b", "mu_s"], observations), 1);
    assert!(found.chi2 < 1e-3);
    assert!(found.uncertainty.is_poor() && found.uncertainty.covariance_ln.is_none());
    assert_eq!(found.uncertainty.condition_number(), f64::INFINITY);
    assert!(found.estimates.iter().all(|e| e.standard_error_ln.is_none()));
    assert!(found.uncertainty.weakest().starts_with("the data say nothing about"));
}

#[test]
fn an_estimate_at_a_bound_is_named() {
    let truth = Truth::new();
    let observations = truth.observe(&truth.everything(), 0.01, Some(&mut Noise::new(1)));
    let mut setting = truth.setting.clone();
    control("mu_s").set(&mut setting, 0.2);
    let unknowns = [("d_m", 10.0, 60.0), ("b", 1e3, 1e5), ("mu_s", 0.1, 0.24)];
    let unknowns = unknowns.map(|(name, smallest, largest)| Unknown {
        control: control(name),
        smallest,
        largest,
    });
    let calibration = Calibration::new(setting.model, unknowns.to_vec(), observations)
        .expect("the calibration makes sense");
    let mut is_within = true;
    let bounds = calibration.bounds_ln();
    let found = fit(&calibration, &Plan::default(), &mut |progress| {
        is_within &= bounds.contain(progress.ln_p);
        ControlFlow::Continue(())
    });
    let found = found.expect("there is a fit");
    assert!(is_within, "no step leaves the bounds");
    let [d, b, mu_s] = found.estimates[..] else { panic!("three parameters were asked for") };
    assert_eq!((mu_s.at_bound, mu_s.value), (Some(Bound::Largest), 0.24));
    assert!(mu_s.standard_error_ln.is_none() && mu_s.interval_95.is_none());
    assert!(d.at_bound.is_none() && b.at_bound.is_none() && b.standard_error_ln.is_some());
    assert_eq!(found.uncertainty.free, [control("d_m"), control("b")]);
    assert_eq!(found.degrees_of_freedom, found.predictions.len() - 2);
    assert!(found.chi2 > 1.5 * found.degrees_of_freedom as f64, "the truth is out of reach");
}

#[test]
fn starts_lead_to_one_minimum_or_have_no_steady_state() {
    let truth = Truth::new();
    let observations = truth.observe(&truth.profiles(), 0.01, Some(&mut Noise::new(4)));
    let calibration = truth.calibration(&["d_m", "mu_s"], observations);
    let found = fitted(&calibration, 6);
    let nowhere = |outcome: &Outcome| matches!(outcome, Outcome::NoSteadyState { .. });
    let lost = found.starts.iter().filter(|start| nowhere(&start.outcome)).count();
    assert!((1..=2).contains(&lost), "{:?}", found.starts);
    assert!(found.without_state >= lost);
    assert_eq!(found.minima, 1);
    assert_eq!(found, fitted(&calibration, 6), "the same seed gives the same fit");
    let other = Plan { seed: 1, ..Plan::default() };
    let other = fit(&calibration, &other, &mut |_| ControlFlow::Continue(())).expect("a fit");
    assert_ne!(found.starts[1].from, other.starts[1].from);
    for (a, b) in found.estimates.iter().zip(&other.estimates) {
        let error = a.standard_error_ln.expect("it is determined");
        assert!((a.value / b.value).ln().abs() < 0.1 * error, "{a:?}, {b:?}");
    }
    let stopped = fit(&calibration, &Plan::default(), &mut |progress| match progress.iteration {
        0 => ControlFlow::Continue(()),
        _ => ControlFlow::Break(()),
    });
    assert_eq!(stopped, Err(CalibrationError::Stopped { solves: 2 }));
}

#[test]
fn places_beyond_the_end_are_counted() {
    let truth = Truth::new();
    let mut observations = truth.observe(&truth.profiles(), 0.01, None);
    let x_m = 1.1 * truth.state.length_m;
    observations.push(Observation {
        observed: Observed::Thickness { x_m },
        value: 10.0,
        standard_error: 20.0,
    });
    let found = fitted(&truth.calibration(&["mu_s"], observations), 1);
    assert_eq!(found.beyond, 1);
    assert!(found.predictions.last().is_some_and(|p| p.is_beyond));
}
