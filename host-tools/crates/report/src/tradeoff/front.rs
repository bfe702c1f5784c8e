//! Pareto front: points that no other beats in both.

/// Which of the points `(cost, error)` are on the front: no other point costs no more
/// and errs less, or costs less and errs no more. What is not a number is on no front.
pub(super) fn front(points: &[(f64, f64)]) -> Vec<bool> {
    let mut order: Vec<usize> = (0..points.len()).collect();
    order.retain(|at| points[*at].0.is_finite() && points[*at].1.is_finite());
    order.sort_by(|a, b| {
        let ((x, y), (u, v)) = (points[*a], points[*b]);
        x.total_cmp(&u).then(y.total_cmp(&v))
    });
    let mut on = vec![false; points.len()];
    let mut least = f64::INFINITY;
    let mut last = None;
    for at in order {
        // Two points alike are both on it.
        if points[at].1 < least || last == Some(points[at]) {
            on[at] = true;
            least = points[at].1;
            last = Some(points[at]);
        }
    }
    on
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_that_another_beats_in_both_are_not_on_the_front() {
        let points = [
            (1.0, 9.0),
            (2.0, 4.0),
            (2.0, 5.0),
            (3.0, 4.0),
            (4.0, 1.0),
            (0.5, 9.5),
        ];
        assert_eq!(front(&points), [true, true, false, false, true, true]);
    }

    #[test]
    fn the_front_is_what_the_definition_says_of_any_points() {
        let mut random = fastrand::Rng::with_seed(6);
        for _ in 0..200 {
            let mut point = || (f64::from(random.u8(..9)), f64::from(random.u8(..9)));
            let points: Vec<_> = (0..12).map(|_| point()).collect();
            let beaten = |(x, y): &(f64, f64)| {
                let by = |(u, v): &(f64, f64)| (u <= x && v < y) || (u < x && v <= y);
                points.iter().any(by)
            };
            let expected: Vec<bool> = points.iter().map(|point| !beaten(point)).collect();
            assert_eq!(front(&points), expected, "{points:?}");
        }
    }

    #[test]
    fn what_is_not_a_number_is_on_no_front_and_hides_nobody() {
        let points = [(1.0, f64::NAN), (2.0, f64::INFINITY), (3.0, 1.0)];
        assert_eq!(front(&points), [false, false, true]);
        assert!(front(&[]).is_empty());
    }
}
