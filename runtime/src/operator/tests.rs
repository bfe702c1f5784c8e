//! The operator against a dense `f64` one, on random and on extreme inputs.

use super::layout::{MAX_SHORT, word};
use super::*;
use crate::Grid;
use crate::haar::{Cells, analyse, synthesise};
use proptest::prelude::*;
use std::collections::BTreeMap;
use std::vec;
use std::vec::Vec;

/// An operator as a list of `(row, index, value)`.
#[derive(Clone, Debug)]
struct Case {
    rows: u16,
    cols: u16,
    entries: Vec<(u16, u16, i16)>,
    shifts: Vec<u16>,
    /// Light of three channels, one after the other.
    frame: Vec<i32>,
}

impl Case {
    /// What a segment of it looks like in an image.
    fn bytes(&self) -> Vec<u8> {
        let last = self.rows * self.cols - 2;
        let mut groups: BTreeMap<usize, Vec<Vec<[u8; 4]>>> = BTreeMap::new();
        for row in self.entries.chunk_by(|a, b| a.0 == b.0) {
            let mut pairs: Vec<(u16, [i16; 2])> = Vec::new();
            for &(_, index, value) in row {
                match pairs.last_mut() {
                    Some((first, values)) if *first + 1 == index => values[1] = value,
                    _ if index > last => pairs.push((last, [0, value])),
                    _ => pairs.push((index, [value, 0])),
                }
            }
            let mut words = vec![word(row[0].0, self.shifts[usize::from(row[0].0)])];
            if pairs.len() > MAX_SHORT {
                words.push(word(pairs.len() as u16, 0));
            }
            for two in pairs.chunks(2) {
                let values = two
                    .iter()
                    .map(|(_, v)| word(v[0].cast_unsigned(), v[1].cast_unsigned()));
                words.extend(values);
                words.push(word(two[0].0, two.get(1).map_or(0, |pair| pair.0)));
            }
            groups
                .entry(pairs.len().min(MAX_SHORT + 1))
                .or_default()
                .push(words);
        }
        let group = |(pairs, rows): (usize, Vec<Vec<[u8; 4]>>)| {
            let long = pairs > MAX_SHORT;
            let mut words = vec![word(if long { 0 } else { pairs as u16 }, rows.len() as u16)];
            let rows = rows.concat();
            words.extend(long.then(|| (rows.len() as u32).to_le_bytes()));
            words.extend(rows);
            words
        };
        groups.into_iter().flat_map(group).flatten().collect()
    }

    fn basis(&self) -> Basis {
        Basis::new(Grid::new(self.rows, self.cols).expect("a small grid"))
    }
}

/// Values small enough that a row of them cannot overflow.
fn case() -> impl Strategy<Value = Case> {
    (1_u16..=9, 2_u16..=9).prop_flat_map(|(rows, cols)| {
        let cells = rows * cols;
        let entry = (0..cells, 0..cells, -800_i16..=800);
        let light = prop_oneof![Just(0), Just(1 << 15), 0..=1 << 15];
        (
            prop::collection::vec(entry, 1..400),
            prop::collection::vec(8_u16..=20, usize::from(cells)),
            prop::collection::vec(light, 3 * usize::from(cells)),
        )
            .prop_map(move |(mut entries, shifts, frame)| {
                entries.sort_unstable();
                entries.dedup_by_key(|entry| (entry.0, entry.1));
                Case {
                    rows,
                    cols,
                    entries,
                    shifts,
                    frame,
                }
            })
    })
}

fn operator<'a>(basis: &Basis, bytes: &'a [u8]) -> Result<Operator<'a>, OperatorError> {
    let segment = Segment::new(0, 1, Channels::All, bytes)?;
    let segments = core::iter::once(segment).collect();
    Operator::new(basis, basis.grid().cells(), segments, [U1F15::ONE; 3])
}

proptest! {
    #[test]
    fn corrections_equal_those_of_the_dense_operator_within_rounding(case in case()) {
        let (basis, bytes) = (case.basis(), case.bytes());
        let operator = operator(&basis, &bytes).expect("values are small enough");
        let (count, cols) = (basis.grid().cells(), basis.grid().cols());
        let [mut a, mut b] = [vec![0; basis.scratch_len()], vec![0; basis.scratch_len()]];
        let mut inputs = vec![0_i16; 3 * count];
        let mut sums = vec![0; 3 * count];
        for (light, inputs) in case.frame.chunks(count).zip(inputs.chunks_mut(count)) {
            analyse(&basis, &Cells { values: light, cols }, [&mut a, &mut b], inputs).expect("sized");
        }
        operator.apply(1, 3, &inputs, &mut sums);

        let functions: Vec<_> = basis.functions().collect();
        let at = |f: &crate::haar::Function, cell: usize| f.at(cell / cols, cell % cols) as f64;
        for (light, sums) in case.frame.chunks(count).zip(sums.chunks(count)) {
            let mut corrections = vec![0; count];
            synthesise(&basis, sums, [&mut a, &mut b], &mut corrections).expect("sized");
            let mut exact = vec![0.0; count];
            let mut tolerance = vec![0.0; count];
            for (row, function) in functions.iter().enumerate() {
                let unit = f64::from(case.shifts[row]).exp2();
                let (mut sum, mut slack) = (0.0, 0.0);
                for entry in case.entries.iter().filter(|e| usize::from(e.0) == row) {
                    let input = &functions[usize::from(entry.1)];
                    let h: f64 = (0..count).map(|cell| at(input, cell) * f64::from(light[cell])).sum();
                    sum += f64::from(entry.2) * h / f64::from(input.input_shift()).exp2();
                    // An input coefficient is rounded to nearest.
                    slack += 0.5 * f64::from(entry.2.unsigned_abs());
                }
                for cell in 0..count {
                    exact[cell] += sum / unit * at(function, cell);
                    // The end of the row rounds down.
                    tolerance[cell] += (slack / unit + 1.0) * at(function, cell).abs();
                }
            }
            for cell in 0..count {
                let difference = (f64::from(corrections[cell]) - exact[cell]).abs();
                prop_assert!(difference <= tolerance[cell] + 1e-6, "{difference} > {}", tolerance[cell]);
                prop_assert!(corrections[cell].unsigned_abs() <= operator.bounds().correction);
            }
        }
    }

    #[test]
    fn any_bytes_make_an_operator_or_an_error(bytes in prop::collection::vec(any::<u8>(), 0..400)) {
        let basis = Basis::new(Grid::new(3, 4).expect("a small grid"));
        if let Ok(segment) = Segment::new(0, 1, Channels::One(2), &bytes) {
            let segments = core::iter::once(segment).collect();
            if let Ok(operator) = Operator::new(&basis, basis.grid().cells(), segments, [U1F15::ONE; 3]) {
                operator.apply(1, 3, &[i16::MAX; 36], &mut [0; 36]);
            }
        }
    }
}

/// One row of a 1 x 4 grid with these values.
fn row_of(values: &[i16], shift: u16) -> Case {
    Case {
        rows: 1,
        cols: 4,
        entries: (0..)
            .zip(values)
            .map(|(index, value)| (2, index, *value))
            .collect(),
        shifts: vec![shift; 4],
        frame: Vec::new(),
    }
}

#[test]
fn an_operator_at_the_edge_of_the_proof_is_taken_and_one_beyond_is_refused() {
    // 2^14 times the magnitudes must fit 2^31 - 1.
    let edge = row_of(&[i16::MAX, i16::MAX, i16::MAX, i16::MAX], 8);
    let (basis, bytes) = (edge.basis(), edge.bytes());
    let operator = operator(&basis, &bytes).expect("131,068 * 2^14 fits");
    assert_eq!(operator.bounds().accumulator, 131_068 << 14);
    let mut sums = [0; 4];
    operator.apply(1, 1, &[1 << 14; 4], &mut sums);
    assert_eq!(sums, [0, 0, (131_068 << 14) >> 8, 0]);
    operator.apply(1, 1, &[-(1 << 14); 4], &mut sums);
    assert_eq!(sums[2], -((131_068 << 14) >> 8));

    let beyond = row_of(&[i16::MIN, i16::MIN, i16::MIN, i16::MIN], 8);
    let bytes = beyond.bytes();
    let refused = super::tests::operator(&basis, &bytes).expect_err("2^31 does not fit");
    assert!(matches!(
        refused,
        OperatorError::AccumulatorOverflow { row: 2, .. }
    ));
}

#[test]
fn a_correction_that_could_leave_its_type_is_refused() {
    let case = row_of(&[i16::MAX, i16::MAX, i16::MAX], 2);
    let (basis, bytes) = (case.basis(), case.bytes());
    let refused = operator(&basis, &bytes);
    assert!(refused.is_ok(), "98,301 * 2^14 / 4 is below 2^30");
    let case = Case {
        entries: (0..12)
            .map(|entry| (entry / 3, entry % 3, i16::MAX))
            .collect(),
        ..case
    };
    let bytes = case.bytes();
    let refused = operator(&basis, &bytes).expect_err("three levels of that are not");
    assert!(
        matches!(refused, OperatorError::CorrectionOverflow { .. }),
        "{refused:?}"
    );
}

#[test]
fn malformed_rows_are_refused_with_their_place() {
    let basis = Basis::new(Grid::new(2, 8).expect("a small grid"));
    let check = |words: &[[u8; 4]]| {
        let bytes: Vec<u8> = words.concat();
        operator(&basis, &bytes).map(|_| ())
    };
    let group = Err(OperatorError::Group { segment: 0 });
    let row = |row| Err(OperatorError::Row { segment: 0, row });
    let bad_index = Err(OperatorError::Index { segment: 0, row: 1 });
    let values = word(1, 1);
    let good = [word(1, 1), word(1, 20), values, word(0, 0)];
    assert_eq!(check(&good), Ok(()));
    assert_eq!(check(&[word(1, 0)]), group, "no rows");
    assert_eq!(check(&[word(9, 1)]), group, "a length that has no group");
    assert_eq!(check(&good[..3]), group, "longer than its segment");
    assert_eq!(
        check(&[good, good].concat()),
        group,
        "a group that comes twice"
    );
    assert_eq!(
        check(&[word(1, 1), word(16, 20), values, word(0, 0)]),
        row(16),
        "beyond the grid"
    );
    for shift in [1, 32] {
        assert_eq!(
            check(&[word(1, 1), word(1, shift), values, word(0, 0)]),
            row(1)
        );
    }
    let again = [word(1, 20), values, word(2, 0)];
    assert_eq!(
        check(&[&[word(1, 2)], &good[1..], &again].concat()),
        row(1),
        "a row that comes twice in a group"
    );
    let longer = [word(2, 1), word(1, 20), values, values, word(0, 2)];
    assert_eq!(check(&longer), Ok(()));
    assert_eq!(
        check(&[&good[..], &longer].concat()),
        row(1),
        "a row in two groups"
    );
    let eight: Vec<_> = (0..4)
        .flat_map(|two| [values, values, word(4 * two, 4 * two + 2)])
        .collect();
    let long = |words: u16, pairs| [word(0, 1), word(words, 0), word(1, 20), word(pairs, 0)];
    assert_eq!(
        check(&[&long(14, 8)[..], &eight].concat()),
        row(1),
        "a short row among the long ones"
    );
    let five = Basis::new(Grid::new(4, 8).expect("a small grid"));
    let nine: Vec<_> = (0..9_u16)
        .collect::<Vec<_>>()
        .chunks(2)
        .flat_map(|two| match *two {
            [first, second] => vec![values, values, word(2 * first, 2 * second)],
            _ => vec![values, word(16, 0)],
        })
        .collect();
    let of_nine = |head: &[[u8; 4]]| {
        let bytes: Vec<u8> = [head, &nine].concat().concat();
        super::tests::operator(&five, &bytes).map(|_| ())
    };
    assert_eq!(of_nine(&long(16, 9)), Ok(()));
    assert_eq!(
        of_nine(&[word(9, 1), word(1, 20)]),
        group,
        "rows of nine pairs in a group of their own"
    );
    assert_eq!(
        check(&[&long(15, 8)[..], &eight, &[values]].concat()),
        row(1),
        "words after the last row"
    );
    assert_eq!(
        check(&[word(1, 1), word(1, 20), values, word(15, 0)]),
        bad_index,
        "a pair that ends beyond the grid"
    );
    assert_eq!(
        check(&[word(1, 1), word(1, 20), values, word(14, 1)]),
        bad_index,
        "something after the last index"
    );
    assert_eq!(
        check(&[word(2, 1), word(1, 20), values, values, word(3, 3)]),
        bad_index,
        "a pair that comes twice"
    );
}

#[test]
fn a_channel_segment_and_a_channel_scale_touch_that_channel_only() {
    let basis = Basis::new(Grid::new(1, 4).expect("a small grid"));
    let bytes = [word(1, 1), word(0, 4), word(64, 0), word(2, 0)].concat();
    let segments =
        core::iter::once(Segment::new(0, 1, Channels::One(1), &bytes).expect("whole words"));
    let half = U1F15::from_num(0.5);
    let scales = [U1F15::ONE, half, U1F15::ONE];
    let operator = Operator::new(&basis, basis.grid().cells(), segments.collect(), scales)
        .expect("well-formed");
    let mut sums = [7; 12];
    operator.apply(1, 3, &[100; 12], &mut sums);
    let mut expected = [0; 12];
    expected[4] = 64 * 100 / 16 / 2;
    assert_eq!(sums, expected);
    operator.apply(0, 3, &[100; 12], &mut sums);
    assert_eq!(sums, [0; 12], "tier 0 has no entries");
    assert_eq!(operator.cost(1, 3), (1, 2));
}

#[test]
fn a_tier_reads_its_own_segments_only() {
    let basis = Basis::new(Grid::new(1, 4).expect("a small grid"));
    let segment = |row, value: i16| {
        [
            word(1, 1),
            word(row, 4),
            word(0, value.cast_unsigned()),
            word(2, 0),
        ]
        .concat()
    };
    let (first, second) = (segment(0, 64), segment(1, 32));
    let segments =
        [(1, &first), (2, &second)]
            .into_iter()
            .enumerate()
            .map(|(index, (tier, bytes))| {
                Segment::new(index, tier, Channels::All, bytes).expect("whole words")
            });
    let operator = Operator::new(
        &basis,
        basis.grid().cells(),
        segments.collect(),
        [U1F15::ONE; 3],
    )
    .expect("well-formed");
    let mut sums = [0; 4];
    operator.apply(2, 1, &[100; 4], &mut sums);
    assert_eq!(sums, [0, 200, 0, 0]);
}
