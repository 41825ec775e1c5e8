//! What is read off a state: transects, budget, caveats, and the error of the grid.

use crate::{assert_close, model, steady};
use melange_solver::diagnose::{
    Budget, Caveat, cfl_time_step_a, inertial_number, strain_rates_per_a,
};
use melange_solver::diagnostic::wedge;
use melange_solver::fjord::Fjord;
use melange_solver::grid_error::{Convergence, grid_error};
use melange_solver::interpolate::{Beyond, Linear, Monotone};
use melange_solver::melt::{Frame, MeltShape};
use melange_solver::physics::closure::UpstreamClosure;
use melange_solver::state::State;
use melange_solver::transect::{transect, wall_strain_rate_per_a};
use melange_solver::{Model, Solver};

/// At a node the transect's mean by Simpson's rule is the node's velocity relative to the walls, u is 0
/// at the wall and grows to the centre.
#[test]
fn transects_carry_the_velocity_of_their_node() {
    let m = model(|p| (p.width_gradient, p.n_cells) = (0.02, 20));
    let s = steady(&m).state;
    for node in [0, 1, 7, 10, 19, 20] {
        let t = transect(&m, &s, 0.0, node as f64 / 20.0);
        assert_eq!(wall_strain_rate_per_a(&m, &s, 0.0, t.chi), t.mu_w.abs() * t.fluidity_per_a[0]);
        let (first, last) = (0, t.velocity_m_per_a.len() - 1);
        let sum: f64 = (t.velocity_m_per_a.iter().enumerate())
            .map(|(i, u)| match i {
                _ if i == first || i == last => *u,
                _ if i % 2 == 1 => 4.0 * u,
                _ => 2.0 * u,
            })
            .sum();
        assert_close("mean", sum / (3.0 * last as f64), s.velocity_m_per_a[node], 1e-9);
        assert!(t.velocity_m_per_a[0].abs() < 1e-300);
        assert!(t.velocity_m_per_a.windows(2).all(|u| u[1] >= u[0] * 0.999));
        assert_close("y", t.y_m[last], t.width_m / 2.0, 1e-12);
    }
    let between = transect(&m, &s, 0.0, 0.475).velocity_m_per_a[100];
    let ends = [9, 10].map(|k| transect(&m, &s, 0.0, k as f64 / 20.0).velocity_m_per_a[100]);
    assert!(between > ends[0] && between < ends[1], "{ends:?} {between}");
}

/// In a fjord of varying width with melt over x, inflow is melt and outflow up to the grid's error.
#[test]
fn the_budget_counts_shapes_and_tables() {
    let widths = Monotone::new(vec![0.0, 5e3, 4e4], vec![4e3, 4.1e3, 4.4e3]).expect("a table");
    let factors = Linear::new(vec![0.0, 4e4], vec![1.0, 0.3]).expect("a table");
    let m = model(|p| p.n_cells = 200)
        .in_fjord(Fjord::table(widths, Beyond::Refused).expect("widths"))
        .with_melt_shape(
            MeltShape::over_x(factors, Frame::Bedrock, Beyond::Refused).expect("factors"),
        );
    let s = steady(&m).state;
    let budget = Budget::of(&m, &s, 0.0);
    assert!(budget.steady_defect().abs() < 1e-3, "{budget:?}");
    assert!(budget.melt_m3_per_a > 0.2 * budget.inflow_m3_per_a);
    assert_close("inflow", budget.inflow_m3_per_a, 6_000.0 * 600.0 * 4_000.0, 1e-12);
}

/// Named shapes have the mean of the uniform one, so that they melt about as much; melt near the end of
/// the mélange shortens it less than melt near the terminus.
#[test]
fn where_it_melts_matters() {
    let length = |name: &str| {
        let shape = MeltShape::named(name).expect("a name");
        steady(&model(|p| p.n_cells = 20).with_melt_shape(shape)).state.length_m
    };
    let lengths = ["linear", "less_linear", "u_shaped", "uniform"].map(length);
    assert!(lengths[0] < lengths[1] && lengths[1] < lengths[3], "{lengths:?}");
}

#[test]
fn a_mélange_beyond_its_tables_is_an_error() {
    let short = |beyond| {
        let widths = Monotone::new(vec![0.0, 9e3], vec![4e3, 4e3]).expect("a table");
        model(|p| p.n_cells = 20).in_fjord(Fjord::table(widths, beyond).expect("widths"))
    };
    let error = Solver::new(short(Beyond::Refused)).steady(None).expect_err("12 km of mélange");
    assert!(error.to_string().contains("the table of `fjord`"), "{error}");
    let thickness = wedge(&short(Beyond::Refused), 75.0);
    let mut solver = Solver::new(short(Beyond::Refused));
    solver.diagnostic(&thickness, 1e4).expect_err("10 km");
    solver.diagnostic(&thickness, 8e3).expect("8 km");
    let held = steady(&short(Beyond::Constant)).state;
    let straight = steady(&model(|p| p.n_cells = 20)).state;
    assert_close("L", held.length_m, straight.length_m, 1e-9);
}

#[test]
fn caveats_are_named() {
    let m = model(|p| p.n_cells = 20);
    let s = steady(&m).state;
    let caveats = |s: &State| Caveat::of(m.parameters(), s, inertial_number(&m, s, 0.0));
    assert_eq!(caveats(&s), []);
    assert_eq!(Caveat::of(m.parameters(), &s, 0.2), [Caveat::Inertial]);
    let (smallest, largest) = strain_rates_per_a(&s);
    assert!(smallest >= -1e-6 && largest > 1.0, "{smallest} {largest}");
    let thin = Solver::new(m.clone()).diagnostic(&wedge(&m, 40.0), 2e3).expect("a solve").state;
    assert!(caveats(&thin).contains(&Caveat::Thin));
    let mut squeezed = s.clone();
    squeezed.velocity_m_per_a[1] = squeezed.velocity_m_per_a[0] - 10.0;
    assert!(caveats(&squeezed).contains(&Caveat::Compression));
    let fastest = s.velocity_m_per_a.iter().copied().fold(0.0, f64::max);
    assert_close("Δt", cfl_time_step_a(&s), s.length_m / 20.0 / fastest, 1e-12);
}

/// The settled model's numbers: the published closure's H₀ moves by +0.14 m from N = 50 to 100 while the
/// truth lies more than 2 m below; a rigid terminus converges in order.
#[test]
fn the_error_of_the_grid_is_told_or_said_to_be_unknown() {
    let m = model(|_| ());
    let told = grid_error(&m, &steady(&m).state).expect("solves").expect("steady states");
    assert_eq!(told.n_cells, [100, 200, 400]);
    assert!(!told.thickness_0.is_asymptotic(), "{:?}", told.thickness_0);
    assert_close("spread", told.thickness_0.error, 149.5547 - 148.4583, 1e-3);
    assert!(told.length.is_asymptotic(), "{:?}", told.length);

    let rigid = Model::new(*m.parameters(), UpstreamClosure::NoStretching).expect("parameters");
    let told = grid_error(&rigid, &steady(&rigid).state).expect("solves").expect("steady states");
    assert!(told.force.is_asymptotic() && told.thickness_0.is_asymptotic(), "{told:?}");
    assert!(told.force.error < 0.01 * told.force.values[2], "{told:?}");
}

/// a + b/N: first order, and the limit is found; with signs that differ there is none.
#[test]
fn convergence_is_extrapolated_only_where_there_is_some() {
    let c = Convergence::of(3.0, [2.0, 1.5, 1.25]);
    assert_eq!((c.observed_order, c.extrapolated, c.error), (Some(1.0), Some(1.0), 2.0));
    let c = Convergence::of(3.0, [2.0, 1.5, 1.75]);
    assert_eq!((c.observed_order, c.extrapolated, c.error), (None, None, 1.5));
    let c = Convergence::of(1.0, [1.0, 2.0, 3.0]);
    assert_eq!((c.observed_order, c.is_asymptotic(), c.error), (Some(0.0), false, 2.0));
}
