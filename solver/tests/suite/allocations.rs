//! Newton's method on the equations asks the system for no memory.

use crate::{model, steady};
use melange_solver::newton::{self, Limits, Workspace};
use melange_solver::physics::continuity::{Before, MassBalance};
use melange_solver::physics::jacobian::Jacobian;
use melange_solver::physics::terminus::{Advance, CalvingLaw};
use melange_solver::physics::{Equations, Problem, Scratch};
use melange_solver::state::unknowns;

/// A step of a season later, with a calving law: several iterations, some with shortened steps.
#[test]
fn an_iteration_allocates_nothing() {
    let start = steady(&model(|p| p.n_cells = 20)).state;
    let m = model(|p| (p.n_cells, p.melt_rate_m_per_day, p.width_gradient) = (20, 0.9, 0.02));
    let before =
        Before { per_step: 4.0, thickness_m: &start.thickness_m, length_m: start.length_m };
    let law = CalvingLaw::steady_feedback(6_000.0, 8e6);
    let problem = Problem {
        parameters: m.parameters(),
        fjord: m.fjord(),
        melt_shape: m.melt_shape(),
        closure: m.closure(),
        balance: MassBalance::Step(before),
        advance: Advance { from_x_m: 0.0, step_a: 0.25, law: Some(law) },
        smoothing: 1e-2,
        relaxation: None,
    };
    let mut scratch = Scratch::new(20);
    let mut workspace = Workspace::new(unknowns(20), Jacobian::zeros(20));
    start.pack(&mut workspace.x);
    let mut equations = Equations::new(problem, &mut scratch);
    let mut iterations = 0;
    let counted = allocation_counter::measure(|| {
        let root = newton::solve(&mut equations, &mut workspace, Limits::default(), "a test");
        iterations = root.map_or(0, |root| root.iterations);
    });
    assert!(iterations > 3, "{iterations}");
    assert_eq!(counted.count_total, 0, "{counted:?}");
}
