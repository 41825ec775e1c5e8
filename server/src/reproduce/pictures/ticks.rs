//! Round numbers along an axis.

/// About so many round numbers from one value to another, each as it is written.
pub fn ticks((low, high): (f64, f64), about: usize) -> Vec<(f64, String)> {
    /// What a step may begin with.
    const ROUND: [f64; 4] = [1.0, 2.0, 5.0, 10.0];
    /// A tick this close to an end, in steps, is on it.
    const ON: f64 = 1e-6;
    let rough = (high - low) / about as f64;
    if !rough.is_finite() || rough <= 0.0 {
        return Vec::new();
    }
    let mut power = rough.log10().floor() as i32;
    let share = rough / 10_f64.powi(power);
    // The step nearest to the rough one, in ratio.
    let nearest = ROUND.iter().position(|r| share <= r * 1.42).unwrap_or(ROUND.len() - 1);
    let mut digit = ROUND[nearest];
    if digit == 10.0 {
        (digit, power) = (1.0, power + 1);
    }
    let decimals = usize::try_from(-power).unwrap_or(0);
    // Whole multiples of a step, divided where it is below 1: 0.3, not 0.30000000000000004.
    let value = |k: i64| {
        let whole = k as f64 * digit;
        if power < 0 { whole / 10_f64.powi(-power) } else { whole * 10_f64.powi(power) }
    };
    let step = value(1);
    let (first, last) = ((low / step - ON).ceil() as i64, (high / step + ON).floor() as i64);
    let written = |v: f64| format!("{v:.decimals$}").replace('-', "\u{2212}");
    (first..=last).map(|k| (value(k), written(value(k)))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn labels(range: (f64, f64), about: usize) -> Vec<String> {
        ticks(range, about).into_iter().map(|(_, label)| label).collect()
    }

    #[test]
    fn ticks_are_round_and_within() {
        assert_eq!(labels((0.0, 3.0), 6), ["0.0", "0.5", "1.0", "1.5", "2.0", "2.5", "3.0"]);
        assert_eq!(
            labels((-0.05, 0.05), 5),
            ["\u{2212}0.04", "\u{2212}0.02", "0.00", "0.02", "0.04"]
        );
        assert_eq!(
            labels((-160.0, 80.0), 5),
            ["\u{2212}150", "\u{2212}100", "\u{2212}50", "0", "50"]
        );
        assert_eq!(labels((0.29, 0.47), 5), ["0.30", "0.35", "0.40", "0.45"]);
        assert_eq!(labels((0.0, 9e4), 4), ["0", "20000", "40000", "60000", "80000"]);
    }

    #[test]
    fn an_axis_without_length_has_none() {
        assert!(ticks((1.0, 1.0), 5).is_empty());
        assert!(ticks((2.0, 1.0), 5).is_empty());
        assert!(ticks((f64::NAN, 1.0), 5).is_empty());
    }
}
