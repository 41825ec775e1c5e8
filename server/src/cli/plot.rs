//! A curve drawn with characters, for the terminal.

/// A place on the drawing, in the units of its axes, with its mark.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Mark {
    /// Abscissa.
    pub x: f64,
    /// Ordinate.
    pub y: f64,
    /// The character.
    pub mark: char,
}

/// Columns of the drawing, its labels not counted.
const COLUMNS: usize = 64;
/// Rows of it.
const ROWS: usize = 20;
/// Columns of the labels on its left, so that a line has 78 in all.
const LABELS: usize = 11;

/// Draws curves and, over them, marks. A curve is drawn with the mark of the point that a stretch leads to.
pub fn plot(curve: &[Mark], marks: &[Mark], x_label: &str, y_label: &str) -> String {
    let all = || curve.iter().chain(marks).filter(|m| m.x.is_finite() && m.y.is_finite());
    let (Some(xs), Some(ys)) = (range(all().map(|m| m.x)), range(all().map(|m| m.y))) else {
        return String::new();
    };
    let mut canvas = vec![vec![' '; COLUMNS]; ROWS];
    for pair in curve.windows(2) {
        let (from, to) = (pair[0], pair[1]);
        let steps = COLUMNS.max(ROWS);
        for step in 0..=steps {
            let share = step as f64 / steps as f64;
            let x = from.x + share * (to.x - from.x);
            let y = from.y + share * (to.y - from.y);
            put(&mut canvas, xs, ys, Mark { x, y, mark: to.mark });
        }
    }
    let alone = Some(curve).filter(|curve| curve.len() == 1).unwrap_or_default();
    alone.iter().chain(marks).for_each(|mark| put(&mut canvas, xs, ys, *mark));
    let mut lines = vec![format!("{y_label:>LABELS$}")];
    for (i, row) in canvas.iter().enumerate() {
        let label = match i {
            0 => number(ys.1),
            _ if i == ROWS / 2 => number(0.5 * (ys.0 + ys.1)),
            _ if i == ROWS - 1 => number(ys.0),
            _ => String::new(),
        };
        let row: String = row.iter().collect();
        lines.push(format!("{label:>LABELS$} |{}", row.trim_end()).trim_end().to_owned());
    }
    lines.push(format!("{:>LABELS$} +{}", "", "-".repeat(COLUMNS)));
    let (left, right) = (number(xs.0), number(xs.1));
    let middle = COLUMNS.saturating_sub(left.len() + right.len());
    lines.push(format!("{:>LABELS$}  {left}{x_label:^middle$}{right}", ""));
    lines.join("\n")
}

fn put(canvas: &mut [Vec<char>], xs: (f64, f64), ys: (f64, f64), mark: Mark) {
    let place = |value: f64, (low, high): (f64, f64), count: usize| {
        ((value - low) / (high - low) * (count - 1) as f64).round().max(0.0) as usize
    };
    let (column, row) = (place(mark.x, xs, COLUMNS), place(mark.y, ys, ROWS));
    if mark.x.is_finite() && mark.y.is_finite() {
        canvas[ROWS - 1 - row.min(ROWS - 1)][column.min(COLUMNS - 1)] = mark.mark;
    }
}

/// Smallest and largest value; of a single value something around it.
fn range(values: impl Iterator<Item = f64> + Clone) -> Option<(f64, f64)> {
    let low = values.clone().fold(f64::INFINITY, f64::min);
    let high = values.fold(f64::NEG_INFINITY, f64::max);
    if low > high {
        return None;
    }
    let aside = if low == high { low.abs().max(1.0) * 0.5 } else { 0.0 };
    Some((low - aside, high + aside))
}

/// A number in five digits, as short as it can be read.
pub fn number(value: f64) -> String {
    let size = value.abs();
    if size == 0.0 {
        "0".to_owned()
    } else if (1e-3..1e6).contains(&size) {
        let digits = (4 - size.log10().floor() as i32).clamp(0, 7) as usize;
        format!("{value:.digits$}")
    } else {
        format!("{value:.3e}")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(x: f64, y: f64, mark: char) -> Mark {
        Mark { x, y, mark }
    }

    #[test]
    fn a_curve_is_joined_and_marked_within_78_columns() {
        let curve = [at(0.1, 20.0, '*'), at(0.5, 10.0, '*'), at(0.1, 1.0, '.')];
        let drawn = plot(&curve, &[at(0.5, 10.0, 'F')], "melt_rate_m_per_day", "length");
        assert!(drawn.lines().all(|line| line.chars().count() <= 78), "{drawn}");
        let marks = |mark| drawn.chars().filter(|c| *c == mark).count();
        assert!(marks('*') > 50 && marks('.') > 50, "{drawn}");
        assert_eq!(marks('F'), 1, "{drawn}");
        assert!(drawn.contains("20.000") && drawn.contains("0.10000"), "{drawn}");
    }

    #[test]
    fn nothing_and_a_single_point_are_drawn_too() {
        assert_eq!(plot(&[], &[], "x", "y"), "");
        assert!(plot(&[at(1.0, 0.0, '*')], &[], "x", "y").contains('*'));
        assert_eq!(plot(&[at(f64::NAN, 0.0, '*')], &[], "x", "y"), "");
    }
}
