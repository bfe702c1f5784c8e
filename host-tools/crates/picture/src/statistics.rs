//! Medians and quantiles of measured values.

/// Numbers with a total order: [`f32`] and [`f64`], NaN above all others.
pub trait Value: Copy {
    /// The order of two of them.
    fn order(&self, other: &Self) -> std::cmp::Ordering;
}

impl Value for f32 {
    fn order(&self, other: &Self) -> std::cmp::Ordering {
        self.total_cmp(other)
    }
}

impl Value for f64 {
    fn order(&self, other: &Self) -> std::cmp::Ordering {
        self.total_cmp(other)
    }
}

/// The middle value, the upper one of two; `None` of none.
#[must_use]
pub fn median<T: Value>(mut values: Vec<T>) -> Option<T> {
    quantile(&mut values, 0.5)
}

/// The value that this share (0 to 1) of all values stays below; `None` of none. The
/// values change their order.
#[must_use]
pub fn quantile<T: Value>(values: &mut [T], share: f64) -> Option<T> {
    let last = values.len().checked_sub(1)?;
    let at = ((values.len() as f64 * share) as usize).min(last);
    Some(*values.select_nth_unstable_by(at, T::order).1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_middle_one_of_several_is_the_median() {
        assert_eq!(median(vec![3.0, 1.0, 2.0]), Some(2.0));
        assert_eq!(median(vec![4.0_f32, 1.0, 3.0, 2.0]), Some(3.0));
        assert_eq!(median::<f64>(Vec::new()), None);
    }

    #[test]
    fn quantiles_of_one_to_a_hundred() {
        let mut values: Vec<f64> = (1..=100).rev().map(f64::from).collect();
        assert_eq!(quantile(&mut values, 0.0), Some(1.0));
        assert_eq!(quantile(&mut values, 0.25), Some(26.0));
        assert_eq!(quantile(&mut values, 1.0), Some(100.0));
    }
}
