//! The methods behind calibration on problems with known answers: steps within bounds, descents, samples of
//! Gaussian densities; and a posterior against the linear estimate where that is good.

use crate::assert_close;
use crate::calibration::{Noise, Truth, fitted};
use melange_solver::calibration::chain::Chain;
use melange_solver::calibration::descent::{
    Bound, Bounds, Ending, LeastSquares, bounded_step, descend,
};
use melange_solver::calibration::posterior;
use melange_solver::calibration::sampler::{Plan, Proposal, SamplerError, sample};
use proptest::prelude::*;
use std::ops::ControlFlow;

proptest! {
    /// The conditions that single out the minimum of a convex quadratic in a box (Karush, Kuhn, Tucker).
    #[test]
    fn bounded_steps_are_minima(
        root in prop::collection::vec(-1.0..1.0_f64, 16),
        g in prop::collection::vec(-2.0..2.0_f64, 4),
        below in prop::collection::vec(0.0..1.0_f64, 4),
        above in prop::collection::vec(0.0..1.0_f64, 4),
        touches in prop::collection::vec(any::<bool>(), 4),
    ) {
        let product = |i: usize, j: usize| (0..4).map(|k| root[4 * k + i] * root[4 * k + j]).sum::<f64>();
        let a = faer::Mat::from_fn(4, 4, |i, j| product(i, j) + if i == j { 0.01 } else { 0.0 });
        let smallest = below.iter().zip(&touches).map(|(x, t)| if *t { 0.0 } else { -x }).collect();
        let room = Bounds { smallest, largest: above };
        let step = bounded_step(&a, &g, &room);
        prop_assert!(room.contain(&step), "{step:?}");
        for k in 0..4 {
            let slope = g[k] + (0..4).map(|j| a[(k, j)] * step[j]).sum::<f64>();
            let may_fall = (step[k] > room.smallest[k] && slope > 1e-9)
                || (step[k] < room.largest[k] && slope < -1e-9);
            prop_assert!(!may_fall, "component {k} of {step:?} slopes by {slope}");
        }
    }
}

/// Rosenbrock's valley, with a place where nothing can be evaluated.
struct Valley;

impl LeastSquares for Valley {
    type Point = ([f64; 2], Vec<f64>);

    fn at(&mut self, theta: &[f64]) -> Option<Self::Point> {
        let (x, y) = (theta[0], theta[1]);
        (x > -1.5).then(|| ([x, y], vec![10.0 * (y - x * x), 1.0 - x]))
    }

    fn residuals(point: &Self::Point) -> &[f64] {
        &point.1
    }

    fn slopes(&mut self, ([x, _], _): &Self::Point) -> Option<Vec<Vec<f64>>> {
        Some(vec![vec![-20.0 * x, -1.0], vec![10.0, 0.0]])
    }
}

#[test]
fn descents_end_at_the_minimum_or_at_a_bound() {
    let bounds = |largest_x: f64| Bounds { smallest: vec![-2.0; 2], largest: vec![largest_x, 2.0] };
    let from = |start: [f64; 2], largest_x: f64| {
        descend(&mut Valley, &bounds(largest_x), &start, 100, &mut |_, _| true)
    };
    let free = from([-1.2, 1.0], 2.0).expect("it can be evaluated");
    assert_eq!((free.ending, free.at_bound), (Ending::Converged, vec![None, None]));
    assert!(free.sum_of_squares < 1e-3);
    let bounded = from([-1.2, 1.0], 0.5).expect("it can be evaluated");
    assert_eq!(bounded.at_bound, [Some(Bound::Largest), None]);
    assert_eq!(bounded.theta[0], 0.5);
    assert!((bounded.theta[1] - 0.25).abs() < 1e-3, "{:?}", bounded.theta);
    assert!(from([-1.8, 1.0], 2.0).is_none());
    let short = descend(&mut Valley, &bounds(2.0), &[-1.2, 1.0], 2, &mut |_, _| true);
    assert_eq!(short.expect("it can be evaluated").ending, Ending::TooManyIterations);
}

const MEANS: [f64; 2] = [3.0, -200.0];
const DEVIATIONS: [f64; 2] = [0.1, 50.0];
const CORRELATION: f64 = 0.9;

fn gaussian(place: &[f64]) -> f64 {
    let z = [0, 1].map(|k| (place[k] - MEANS[k]) / DEVIATIONS[k]);
    let squared = z[0] * z[0] - 2.0 * CORRELATION * z[0] * z[1] + z[1] * z[1];
    -0.5 * squared / (1.0 - CORRELATION * CORRELATION)
}

fn gaussian_chain(plan: &Plan) -> Chain {
    let start = (0..plan.walkers).map(|w| {
        let place = (w as f64 + 0.5) / plan.walkers as f64 - 0.5;
        vec![MEANS[0] + place * DEVIATIONS[0], MEANS[1] + (7.0 * place).sin() * DEVIATIONS[1]]
    });
    let mut evaluate =
        |proposals: &[Proposal]| proposals.iter().map(|p| gaussian(&p.place)).collect();
    sample(plan, start.collect(), &mut evaluate, &mut |_| ControlFlow::Continue(()))
        .expect("the density can be sampled")
}

#[test]
fn samples_of_a_gaussian_have_its_moments() {
    let plan = Plan { walkers: 20, steps: 6000, burn_in: 500, thinning: 5, seed: 1 };
    let chain = gaussian_chain(&plan);
    assert_eq!((chain.kept(), chain.samples().len()), (1100, 22_000));
    assert!(chain.is_complete() && chain.is_long_enough());
    // Of a stretch move in two dimensions.
    assert!((0.6..0.8).contains(&chain.acceptance()), "{}", chain.acceptance());
    for k in 0..2 {
        // Four standard errors of what so many independent samples tell.
        let error = 4.0 / chain.effective_samples(k).sqrt();
        assert!(error < 0.1, "{error}");
        let mean = (chain.mean(k) - MEANS[k]) / DEVIATIONS[k];
        assert!(mean.abs() < error, "mean {k}: {mean} ± {error}");
        let deviation = chain.standard_deviation(k) / DEVIATIONS[k];
        assert!((deviation - 1.0).abs() < error, "deviation {k}: {deviation} ± {error}");
        let quantiles = chain.quantiles(k, [0.025, 0.5, 0.975]);
        for (quantile, z) in quantiles.iter().zip([-1.96, 0.0, 1.96]) {
            let found = (quantile - MEANS[k]) / DEVIATIONS[k];
            assert!((found - z).abs() < 3.0 * error, "quantile {k}: {found}, {z} ± {error}");
        }
    }
    assert!((chain.correlation()[0][1] - CORRELATION).abs() < 0.02);
    assert_eq!(chain, gaussian_chain(&plan), "the same seed gives the same samples");
    assert_ne!(chain, gaussian_chain(&Plan { seed: 2, ..plan }));
}

#[test]
fn effective_samples_foresee_how_far_means_scatter() {
    const CHAINS: u64 = 60;
    let mut scatter = 0.0;
    let mut foreseen = 0.0;
    for seed in 0..CHAINS {
        let plan = Plan { walkers: 12, steps: 2200, burn_in: 200, thinning: 2, seed };
        let chain = gaussian_chain(&plan);
        scatter += ((chain.mean(0) - MEANS[0]) / DEVIATIONS[0]).powi(2) / CHAINS as f64;
        foreseen += 1.0 / chain.effective_samples(0) / CHAINS as f64;
    }
    assert!((0.6..1.6).contains(&(scatter / foreseen)), "{scatter}, {foreseen}");
}

#[test]
fn a_short_chain_says_so_and_a_senseless_plan_is_refused() {
    let plan = Plan { walkers: 20, steps: 300, burn_in: 100, thinning: 1, seed: 1 };
    assert!(!gaussian_chain(&plan).is_long_enough());
    let refused = |plan: Plan| match plan.check(3) {
        Err(SamplerError::OutOfRange { field, .. }) => field,
        other => panic!("expected a refusal, got {other:?}"),
    };
    assert_eq!(refused(Plan { walkers: 8, ..plan }), "walkers");
    assert_eq!(refused(Plan { walkers: 21, ..plan }), "walkers");
    assert_eq!(refused(Plan { thinning: 0, ..plan }), "thinning");
    assert_eq!(refused(Plan { steps: 101, ..plan }), "steps");
    let mut nowhere = |proposals: &[Proposal]| vec![f64::NEG_INFINITY; proposals.len()];
    let start = vec![vec![0.0; 2]; plan.walkers];
    let failed = sample(&plan, start, &mut nowhere, &mut |_| ControlFlow::Continue(()));
    assert_eq!(failed, Err(SamplerError::NoDensity { walker: 0, log_density: f64::NEG_INFINITY }));
}

#[test]
fn a_posterior_is_what_the_linear_estimate_says_where_that_is_good() {
    let truth = Truth::new();
    let observations = truth.observe(&truth.profiles(), 0.01, Some(&mut Noise::new(6)));
    let calibration = truth.calibration(&["d_m", "mu_s"], observations);
    let fit = fitted(&calibration, 1);
    let plan = Plan { walkers: 16, steps: 1500, burn_in: 200, thinning: 1, seed: 0 };
    let mut steps = 0;
    let found = posterior::sample(&calibration, &fit, &plan, &mut |progress| {
        steps = progress.step;
        ControlFlow::Continue(())
    });
    let found = found.expect("there is a posterior");
    assert_eq!((steps, found.solves), (1500, 16 * (1500 + 2)));
    for (marginal, estimate) in found.marginals.iter().zip(&fit.estimates) {
        let error = estimate.standard_error_ln.expect("it is determined");
        assert!(marginal.effective_samples > 300.0, "{marginal:?}");
        assert!((marginal.mean_ln - estimate.value.ln()).abs() < 0.25 * error, "{marginal:?}");
        assert!(
            (marginal.standard_deviation_ln / error - 1.0).abs() < 0.15,
            "{marginal:?}, {error}"
        );
        let [from, to] = estimate.interval_95.expect("it is determined");
        assert!((marginal.quantiles[0] / from).ln().abs() < 0.4 * error, "{marginal:?}");
        assert!((marginal.quantiles[2] / to).ln().abs() < 0.4 * error, "{marginal:?}");
    }
    let linear = fit.uncertainty.correlation.as_ref().expect("both are free")[0][1];
    assert_close("correlation", found.correlation[0][1], linear, 0.02);
    // The lowest χ² that was met is hardly below that of the fit.
    let best = found.chain.log_densities().iter().copied().fold(f64::NEG_INFINITY, f64::max);
    assert!(-2.0 * best > fit.chi2 - 1e-3 && -2.0 * best < fit.chi2 + 0.1, "{best}, {}", fit.chi2);

    let stopped = posterior::sample(&calibration, &fit, &plan, &mut |progress| {
        if progress.step < 300 { ControlFlow::Continue(()) } else { ControlFlow::Break(()) }
    });
    let stopped = stopped.expect("a hundred steps were kept").chain;
    assert!(!stopped.is_complete());
    assert_eq!(stopped.kept(), 100);
    assert_eq!(stopped.log_densities(), &found.chain.log_densities()[..1600]);
}
