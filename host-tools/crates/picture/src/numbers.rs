//! Numbers as people read them, and round numbers for the ticks of an axis.

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

/// A number of about three digits, without zeros at its end.
#[must_use]
pub fn number(value: f64) -> String {
    if value == 0.0 {
        return "0".to_owned();
    }
    let magnitude = value.abs().log10().floor() as i32;
    if magnitude < -4 {
        return format!("{value:.0e}").replace('-', "\u{2212}");
    }
    let places = (2 - magnitude).max(0) as usize;
    let text = format!("{value:.places$}");
    if text.contains('.') {
        text.trim_end_matches('0').trim_end_matches('.').to_owned()
    } else {
        text
    }
}

/// A share as a percentage: tenths from 10 up, hundredths from 1 up, two digits
/// below.
#[must_use]
pub fn percent(share: f64) -> String {
    let percent = 100.0 * share;
    let places = match percent {
        10.0.. => 1,
        1.0.. => 2,
        _ if percent > 0.0 => 1 - percent.log10().floor() as i32,
        _ => 0,
    };
    format!("{percent:.0$}\u{202f}%", places.clamp(0, 6) as usize)
}

/// A whole number with its thousands apart.
#[must_use]
pub fn grouped(value: u64) -> String {
    let digits = value.to_string();
    let first = digits.len() % 3;
    let mut groups: Vec<&str> = Vec::new();
    if first > 0 {
        groups.push(&digits[..first]);
    }
    groups.extend(
        (first..digits.len())
            .step_by(3)
            .map(|start| &digits[start..start + 3]),
    );
    groups.join("\u{202f}")
}
