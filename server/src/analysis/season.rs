//! A number that answers to another one that swings: when, how much and how alike. Numbers over time, which need not
//! be evenly spaced: no queue, no transport.

use serde::Serialize;
use std::f64::consts::TAU;
use utoipa::ToSchema;

/// Numbers over time.
#[derive(Debug, Clone, PartialEq)]
pub struct Track {
    /// Times, ascending.
    pub time: Vec<f64>,
    /// A number for each time.
    pub value: Vec<f64>,
}

/// What a number comes to over a stretch of time.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, ToSchema)]
pub struct SeasonRange {
    /// Mean over time.
    pub mean: f64,
    /// Least value.
    pub min: f64,
    /// Largest value.
    pub max: f64,
}

/// Whether a response rises with what forces it, or falls.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Sense {
    /// It is highest after the forcing was highest.
    With,
    /// It is lowest after the forcing was highest.
    Against,
}

impl Sense {
    /// 1 or −1.
    pub fn sign(self) -> f64 {
        match self {
            Self::With => 1.0,
            Self::Against => -1.0,
        }
    }
}

/// How long before an extreme of the forcing one of the response may lie, and how long after it, in periods.
const WINDOW: (f64, f64) = (-0.25, 0.5);
/// Least lag of the swing as a whole, in periods: what answers at once may seem to come a little early. Lags go
/// from here to half a period more.
const LEAST_LAG: f64 = -1.0 / 12.0;
/// Times closer than this, in periods, are one.
const SAME: f64 = 1e-9;
/// What varies by less than this, relatively, does not: that may be rounding.
const ROUNDING: f64 = 1e-12;

impl Track {
    /// The last `length` of it, beginning with a value between its neighbours' where there is none; none if it is
    /// shorter.
    pub fn last(&self, length: f64) -> Option<Self> {
        let from = self.time.last()? - length;
        let slack = SAME * length;
        let first = self.time.iter().position(|t| *t >= from - slack)?;
        let mut track =
            Self { time: self.time[first..].to_vec(), value: self.value[first..].to_vec() };
        if self.time[first] > from + slack {
            let before = first.checked_sub(1)?;
            let share = (from - self.time[before]) / (self.time[first] - self.time[before]);
            let value = self.value[before] + share * (self.value[first] - self.value[before]);
            track.time.insert(0, from);
            track.value.insert(0, value);
        }
        Some(track)
    }

    /// Half the time between its neighbours, for each time: what a sum over the track weighs it by.
    pub fn weights(&self) -> Vec<f64> {
        let n = self.time.len();
        let time = |i: usize| self.time[i];
        (0..n).map(|i| 0.5 * (time((i + 1).min(n - 1)) - time(i.saturating_sub(1)))).collect()
    }

    /// What it comes to; none of a single moment.
    pub fn range(&self) -> Option<SeasonRange> {
        let mean = mean(&self.weights(), &self.value)?;
        let min = self.value.iter().copied().fold(f64::INFINITY, f64::min);
        let max = self.value.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        Some(SeasonRange { mean, min, max })
    }

    /// Other numbers at the same times.
    fn with(&self, value: Vec<f64>) -> Self {
        Self { time: self.time.clone(), value }
    }

    /// When it has its extreme near a time at which what forces it has one: the largest for `sign` = 1, the
    /// smallest for −1; from a quarter of a period before to half a period after. By the parabola through the
    /// extreme sample and its neighbours; none if the extreme is no turn.
    pub fn extreme(&self, forced: f64, period: f64, sign: f64) -> Option<f64> {
        let is_near = |t: f64| (WINDOW.0 * period..WINDOW.1 * period).contains(&(t - forced));
        let near: Vec<usize> = (0..self.time.len()).filter(|i| is_near(self.time[*i])).collect();
        let value = |i: usize| sign * self.value[near[i]];
        let at = (1..near.len().checked_sub(1)?).max_by(|a, b| value(*a).total_cmp(&value(*b)))?;
        let time = |i: usize| self.time[near[i]];
        let (left, middle, right) = (time(at - 1), time(at), time(at + 1));
        let rising = (value(at) - value(at - 1)) / (middle - left);
        let falling = (value(at + 1) - value(at)) / (right - middle);
        let bend = (falling - rising) / (right - left);
        let is_turn = rising >= 0.0 && falling <= 0.0 && bend < 0.0;
        is_turn.then(|| 0.5 * (left + middle) - 0.5 * rising / bend)
    }

    /// The last of the times `at` + whole periods about which an extreme of the response can be looked for.
    pub fn last_forced(&self, at: f64, period: f64) -> Option<f64> {
        let (first, end) = (self.time.first()?, self.time.last()?);
        let periods = ((end - WINDOW.1 * period - at) / period + SAME).floor();
        let last = at + periods * period;
        (last + WINDOW.0 * period >= first - SAME * period).then_some(last)
    }

    /// Whether a response over the same times, one period, goes with this one or against it: its swing, less the
    /// drift from end to end, then lags by −1/12 to 5/12 of the period. By the first harmonic; none if it does not
    /// swing.
    pub fn sense_of(&self, response: &Self, period: f64) -> Option<Sense> {
        let ends = |v: &[f64]| Some((*v.first()?, *v.last()?));
        let ((from, to), (low, high)) = (ends(&self.time)?, ends(&response.value)?);
        let drift = (high - low) / (to - from);
        let steady = self.time.iter().zip(&response.value).map(|(t, y)| y - drift * (t - from));
        let steady: Vec<f64> = steady.collect();
        let SeasonRange { min, max, .. } = self.with(steady.clone()).range()?;
        if max - min <= ROUNDING * min.abs().max(max.abs()) {
            return None;
        }
        let phase = |values: &[f64]| {
            let mean = mean(&self.weights(), values)?;
            let (mut re, mut im) = (0.0, 0.0);
            for ((t, w), y) in self.time.iter().zip(self.weights()).zip(values) {
                let (sin, cos) = (TAU * (t - from) / period).sin_cos();
                re += w * (y - mean) * cos;
                im += w * (y - mean) * sin;
            }
            (re != 0.0 || im != 0.0).then(|| im.atan2(re) / TAU)
        };
        let lag = phase(&steady)? - phase(&self.value)?;
        let is_with = (lag - LEAST_LAG).rem_euclid(1.0) < 0.5;
        Some(if is_with { Sense::With } else { Sense::Against })
    }
}

/// Mean of numbers, each with its weight; none if nothing weighs anything.
pub fn mean(weights: &[f64], values: &[f64]) -> Option<f64> {
    let total: f64 = weights.iter().sum();
    let sum: f64 = weights.iter().zip(values).map(|(w, v)| w * v).sum();
    (total > 0.0).then(|| sum / total)
}

/// Pearson's correlation of two numbers, each pair with its weight; none if one of them is always the same.
pub fn correlation(weights: &[f64], x: &[f64], y: &[f64]) -> Option<f64> {
    let (mean_x, mean_y) = (mean(weights, x)?, mean(weights, y)?);
    let sum = |f: &dyn Fn(f64, f64) -> f64| -> f64 {
        let pairs = x.iter().zip(y).map(|(x, y)| f(x - mean_x, y - mean_y));
        weights.iter().zip(pairs).map(|(w, product)| w * product).sum()
    };
    let (xx, xy, yy) = (sum(&|x, _| x * x), sum(&|x, y| x * y), sum(&|_, y| y * y));
    let varies =
        |squares: f64, mean: f64| squares > (ROUNDING * mean).powi(2) * weights.iter().sum::<f64>();
    (varies(xx, mean_x) && varies(yy, mean_y)).then(|| (xy / (xx * yy).sqrt()).clamp(-1.0, 1.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A sinusoid that is highest at `high`, at times that are unevenly spaced.
    fn swing(mean: f64, amplitude: f64, period: f64, high: f64, end: f64) -> Track {
        let n = 400;
        let time: Vec<f64> = (0..=n)
            .map(|i| {
                let share = f64::from(i) / f64::from(n);
                end * (share + 0.001 * (TAU * 7.0 * share).sin())
            })
            .collect();
        let value = time.iter().map(|t| mean + amplitude * (TAU * (t - high) / period).cos());
        Track { value: value.collect(), time }
    }

    fn assert_near(got: f64, expected: f64, error: f64) {
        assert!((got - expected).abs() < error, "{got} is not {expected}");
    }

    #[test]
    fn a_shifted_sinusoid_lags_by_its_shift() {
        let period = 2.0;
        let forcing = swing(1.0, 0.2, period, 0.5, 7.3);
        for (lag, amplitude, sense) in [
            (0.0, 3.0, Sense::With),
            (0.3, 3.0, Sense::With),
            (0.8, 3.0, Sense::With),
            (0.1, -3.0, Sense::Against),
            (0.6, -3.0, Sense::Against),
        ] {
            let response = swing(10.0, amplitude, period, 0.5 + lag, 7.3);
            let last = |track: &Track| track.last(period).expect("a whole period");
            let told = last(&forcing).sense_of(&last(&response), period);
            assert_eq!(told, Some(sense), "{lag}");
            let sign = sense.sign();
            for (at, sign) in [(0.5, sign), (1.5, -sign)] {
                let forced = response.last_forced(at, period).expect("a swing");
                assert!(forced + 0.5 * period <= 7.3 && forced + 1.5 * period > 7.3);
                let found = response.extreme(forced, period, sign).expect("an extreme");
                assert_near(found - forced, lag, 1e-3);
            }
            let range = last(&response).range().expect("a range");
            assert_near(range.mean, 10.0, 1e-3);
            assert_near(range.max - range.min, 6.0, 1e-2);
            let (f, r) = (last(&forcing), last(&response));
            let found = correlation(&f.weights(), &f.value, &r.value).expect("they vary");
            assert_near(found, amplitude.signum() * (TAU * lag / period).cos(), 2e-3);
        }
    }

    /// A drift of several amplitudes a period does not turn a swing round.
    #[test]
    fn a_drift_is_no_swing() {
        let forcing = swing(1.0, 0.2, 1.0, 0.25, 3.0);
        let mut response = swing(10.0, -1.0, 1.0, 0.45, 3.0);
        for (t, y) in response.time.iter().zip(&mut response.value) {
            *y += 5.0 * t;
        }
        let last = |track: &Track| track.last(1.0).expect("a year");
        assert_eq!(last(&forcing).sense_of(&last(&response), 1.0), Some(Sense::Against));
        let still = Track { value: vec![4.0; forcing.time.len()], ..forcing.clone() };
        assert_eq!(last(&forcing).sense_of(&last(&still), 1.0), None);
        assert_eq!(correlation(&forcing.weights(), &forcing.value, &still.value), None);
        assert_eq!(still.extreme(1.25, 1.0, 1.0), None);
    }

    #[test]
    fn a_track_that_is_too_short_has_no_last_period() {
        let track = Track { time: vec![0.0, 0.5, 1.0], value: vec![1.0, 3.0, 5.0] };
        assert_eq!(track.last(1.5), None);
        let last = track.last(0.75).expect("it is long enough");
        assert_eq!((last.time, last.value), (vec![0.25, 0.5, 1.0], vec![2.0, 3.0, 5.0]));
        assert_eq!(track.last(1.0).map(|t| t.time.len()), Some(3));
        assert_eq!(track.last_forced(0.25, 1.0), Some(0.25));
        assert_eq!(track.last_forced(0.75, 1.0), None);
        assert_eq!(track.weights(), [0.25, 0.5, 0.25]);
        assert_eq!(track.range(), Some(SeasonRange { mean: 3.0, min: 1.0, max: 5.0 }));
    }
}
