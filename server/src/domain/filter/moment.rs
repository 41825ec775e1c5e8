//! Moments as filters write them: `2026`, `2026-11`, `2026-11-01`, `2026-11-01T12:30:00.5Z`. All are UTC and
//! beginnings of what is stored, so that they are compared as texts.

/// The moment without its zone, if the text is one.
pub(super) fn checked(text: &str) -> Option<&str> {
    /// What stands at which place of a whole moment; `0` is any digit.
    const FORM: &[u8] = b"0000-00-00T00:00:00.000";
    /// Lengths at which a moment may end; fractions of a second have any number of digits.
    const ENDS: [usize; 6] = [4, 7, 10, 13, 16, 19];
    let bare = text.strip_suffix('Z').filter(|bare| bare.len() > 10).unwrap_or(text);
    let fits = |(character, form): (u8, &u8)| match form {
        b'0' => character.is_ascii_digit(),
        form => character == *form,
    };
    let is_whole = ENDS.contains(&bare.len()) || (21..=FORM.len()).contains(&bare.len());
    if !is_whole || !bare.bytes().zip(FORM).all(fits) {
        return None;
    }
    let number =
        |from: usize| bare.get(from..from + 2).and_then(|digits| digits.parse::<u32>().ok());
    let year: u32 = bare.get(..4)?.parse().ok()?;
    let in_range = |from: usize, low: u32, high: u32| {
        number(from).is_none_or(|number| (low..=high).contains(&number))
    };
    let days = days_of(year, number(5).unwrap_or(1));
    let exists = in_range(5, 1, 12)
        && in_range(8, 1, days)
        && in_range(11, 0, 23)
        && in_range(14, 0, 59)
        && in_range(17, 0, 59);
    exists.then_some(bare)
}

fn days_of(year: u32, month: u32) -> u32 {
    let is_leap = year.is_multiple_of(4) && (!year.is_multiple_of(100) || year.is_multiple_of(400));
    match month {
        2 if is_leap => 29,
        2 => 28,
        4 | 6 | 9 | 11 => 30,
        _ => 31,
    }
}

#[cfg(test)]
mod tests {
    use super::checked;

    #[test]
    fn moments_end_after_any_of_their_parts() {
        for text in [
            "2026",
            "2026-11",
            "2026-11-01",
            "2026-11-01T12",
            "2026-11-01T12:30",
            "2026-11-01T12:30:59",
            "2026-11-01T12:30:59.5",
            "2026-11-01T12:30:59.123",
            "2024-02-29",
        ] {
            assert_eq!(checked(text), Some(text));
        }
        assert_eq!(checked("2026-11-01T12:30:59.123Z"), Some("2026-11-01T12:30:59.123"));
    }

    #[test]
    fn what_is_no_moment_is_none() {
        for text in [
            "",
            "26",
            "2026-1",
            "2026-13",
            "2026-00",
            "2026-11-31",
            "2026-02-29",
            "1900-02-29",
            "2026-11-01 12",
            "2026-11-01T24",
            "2026-11-01T12:60",
            "2026-11-01T12:30:60",
            "2026-11-01T12:30:59.",
            "2026-11-01T12:30:59.1234",
            "2026-11-01T12:30+01:00",
            "2026Z",
            "yesterday",
            "２０２６",
        ] {
            assert_eq!(checked(text), None, "{text}");
        }
    }
}
