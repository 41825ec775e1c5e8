//! Colours that eyes of all kinds tell apart, on paper and without colour by their lightness: viridis
//! (van der Walt and Smith, CC0), as far as it is dark enough for lines on white.

/// What is compared with.
pub const BLACK: &str = "#000000";

/// Viridis at even steps, from its dark end.
const VIRIDIS: [[u8; 3]; 9] = [
    [68, 1, 84],
    [72, 40, 120],
    [62, 74, 137],
    [49, 104, 142],
    [38, 130, 142],
    [31, 158, 137],
    [53, 183, 121],
    [109, 205, 89],
    [180, 222, 44],
];

/// The colour of one of so many things in order.
pub fn of(index: usize, count: usize) -> String {
    /// Up to here, as an index of the steps, it is dark enough.
    const LAST: f64 = 7.3;
    let place = LAST * index as f64 / (count.max(2) - 1) as f64;
    let step = (place.floor() as usize).min(VIRIDIS.len() - 2);
    let share = place - step as f64;
    let mixed = |i: usize| {
        let [from, to] = [step, step + 1].map(|k| f64::from(VIRIDIS[k][i]));
        (from + share * (to - from)).round() as u8
    };
    format!("#{:02x}{:02x}{:02x}", mixed(0), mixed(1), mixed(2))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn colours_grow_lighter() {
        assert_eq!(of(0, 6), "#440154");
        let light = |colour: &str| {
            let part = |at: usize| u32::from_str_radix(&colour[at..at + 2], 16).expect("hex");
            2 * part(1) + 7 * part(3) + part(5)
        };
        let all: Vec<u32> = (0..8).map(|i| light(&of(i, 8))).collect();
        assert!(all.is_sorted_by(|a, b| a < b), "{all:?}");
        assert_eq!(of(0, 1), of(0, 2), "one thing alone has a colour too");
    }
}
