//! Number words: numbers as people read them, in plain letters for terminals and
//! pictures; and round numbers for the ticks of an axis.
//!
//! [`html`](crate::html) has the same words for pages.

/// Multiples of 1, 2 or 5 times a power of ten in a range, at most `most + 1`.
#[must_use]
pub fn steps(low: f64, high: f64, most: usize) -> Vec<f64> {
    let width = (high - low) / most.max(1) as f64;
    if !(width.is_finite() && width > 0.0) {
        return vec![low];
    }
    let power = 10_f64.powf(width.log10().floor());
    let step = [1.0, 2.0, 5.0, 10.0].map(|factor| factor * power);
    // A width that is a step itself may differ from it by rounding.
    let step = step.into_iter().find(|step| *step >= width * (1.0 - 1e-9));
    let step = step.unwrap_or(width);
    let first = (low / step - 1e-9).ceil() as i64;
    let last = (high / step + 1e-9).floor() as i64;
    (first..=last).map(|count| count as f64 * step).collect()
}

/// Powers of ten in a range.
#[must_use]
pub fn decades(low: f64, high: f64) -> Vec<f64> {
    let first = (low.log10() - 1e-9).ceil() as i32;
    let last = (high.log10() + 1e-9).floor() as i32;
    (first..=last).map(|power| 10_f64.powi(power)).collect()
}

/// Three significant digits without zeros at their end: `0.0123`, `87.7`, `1234`, `1.5e-5`;
/// `-` of what is no number.
#[must_use]
pub fn number(value: f64) -> String {
    if !value.is_finite() {
        return "-".to_owned();
    }
    if value == 0.0 {
        return "0".to_owned();
    }
    let short = |digits: &str| match digits.split_once('.') {
        Some(_) => digits
            .trim_end_matches('0')
            .trim_end_matches('.')
            .to_owned(),
        None => digits.to_owned(),
    };
    let magnitude = value.abs().log10().floor() as i32;
    if (-4..6).contains(&magnitude) {
        let places = (2 - magnitude).max(0) as usize;
        return short(&format!("{value:.places$}"));
    }
    let text = format!("{value:.2e}");
    let (digits, power) = text.split_once('e').unwrap_or((&text, "0"));
    format!("{}e{power}", short(digits))
}

/// A share as a percentage: `12.3 %`.
#[must_use]
pub fn percent(share: f64) -> String {
    format!("{} %", number(100.0 * share))
}

/// A whole number with its thousands apart: `1,234,567`.
#[must_use]
pub fn grouped(value: u64) -> String {
    let digits = value.to_string();
    let groups: Vec<&[u8]> = digits.as_bytes().rchunks(3).rev().collect();
    String::from_utf8_lossy(&groups.join(&b',')).into_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_keep_three_digits_that_count() {
        let shown = [
            0.0,
            0.012_34,
            0.5,
            99.96,
            1234.4,
            -0.000_2,
            0.000_012_34,
            2.5e9,
            f64::INFINITY,
        ];
        assert_eq!(
            shown.map(number),
            [
                "0", "0.0123", "0.5", "100", "1234", "-0.0002", "1.23e-5", "2.5e9", "-"
            ]
        );
    }

    #[test]
    fn shares_keep_their_digits() {
        let shown = [0.8766, 0.0123, 0.000_051, 0.0, -0.000_002];
        assert_eq!(
            shown.map(percent),
            ["87.7 %", "1.23 %", "0.0051 %", "0 %", "-0.0002 %"]
        );
    }

    #[test]
    fn large_counts_have_commas() {
        let shown = [0, 12, 123, 1_234, 1_234_567];
        assert_eq!(shown.map(grouped), ["0", "12", "123", "1,234", "1,234,567"]);
    }
}
