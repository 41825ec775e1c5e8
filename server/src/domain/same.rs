//! When two numbers are the same: one tolerance, for who asks what varies and for who asks what is alike. Knows no run.

/// Share of their size by which numbers may differ that are the same: far above rounding, far below what anybody sets.
const SHARE: f64 = 1e-12;

/// Whether two numbers differ by no more than rounding does. What is computed comes out in the last digits as the
/// way to it has it: a flux over a thickness is 9009.999999999998 here and 9010 there.
pub fn same(a: f64, b: f64) -> bool {
    let size = a.abs().max(b.abs());
    a == b || size.is_finite() && (a - b).abs() <= SHARE * size
}

/// The same of numbers that may not exist, none of which is like none.
pub fn same_if_any(a: Option<f64>, b: Option<f64>) -> bool {
    match (a, b) {
        (Some(a), Some(b)) => same(a, b),
        _ => a == b,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rounding_makes_no_other_number() {
        assert!(same(9009.999999999998, 9010.0) && same(0.1 + 0.2, 0.3) && same(-0.0, 0.0));
        assert!(same(-1e-300, -1e-300) && same(f64::INFINITY, f64::INFINITY));
        for (a, b) in [(1.0, 1.0 + 1e-11), (0.0, 1e-300), (1.0, -1.0), (f64::INFINITY, 1.0)] {
            assert!(!same(a, b), "{a} and {b}");
        }
        assert!(same_if_any(Some(0.3), Some(0.1 + 0.2)) && same_if_any(None, None));
        assert!(!same_if_any(None, Some(0.0)) && !same_if_any(Some(1.0), Some(2.0)));
    }
}
