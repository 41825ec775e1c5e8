//! What the parameter table lets through.

use melange_solver::Model;
use melange_solver::params::{PARAMETERS, ParameterError, Parameters};
use melange_solver::physics::closure::UpstreamClosure;

#[test]
fn defaults_lie_within_their_ranges_and_are_the_base_case() {
    let p = Parameters::default();
    p.check().expect("defaults are permitted");
    for info in &PARAMETERS {
        assert_eq!((info.get)(&p), info.default, "{}", info.name);
    }
}

#[test]
fn a_bad_value_is_refused_with_field_value_and_range() {
    for value in [f64::NAN, f64::INFINITY, -1.0, 1e9] {
        let error = Parameters::default().set("width_m", value).expect_err("out of range");
        let text = error.to_string();
        assert!(text.contains("width_m") && text.contains("from 10 to 1000000 m"), "{text}");
        assert!(text.contains(&value.to_string()), "{text}");
    }
    let error = Parameters::default().set("n_cells", 50.5).expect_err("not whole");
    assert!(error.to_string().contains("a whole number from 8 to 4000"), "{error}");
    let error = Parameters::default().set("width", 1.0).expect_err("unknown");
    assert!(matches!(error, ParameterError::Unknown { .. }));
}

#[test]
fn icebergs_thicker_than_the_terminus_are_refused() {
    let p = Parameters { d_m: 700.0, ..Parameters::default() };
    let error = Model::new(p, UpstreamClosure::Published).expect_err("d > H_t");
    assert!(error.to_string().contains("terminus_thickness_m = 600"), "{error}");
}
