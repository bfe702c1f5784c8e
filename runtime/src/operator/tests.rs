//! The operator against a dense `f64` one, on random and on extreme inputs.

use super::*;
use crate::Grid;
use crate::haar::{analyse_rounded, synthesise};
use crate::image::layout::segment::word;
use proptest::prelude::*;
use std::vec;
use std::vec::Vec;

/// An operator as a list of `(row, index, value)`, and what one segment of it
/// looks like in an image.
#[derive(Clone, Debug)]
struct Case {
    rows: u16,
    cols: u16,
    entries: Vec<(u16, u16, i16)>,
    shifts: Vec<u8>,
    frame: Vec<[u16; 3]>,
}

impl Case {
    fn bytes(&self) -> Vec<u8> {
        let by_row = self.entries.chunk_by(|a, b| a.0 == b.0);
        let row = |row: &[(u16, u16, i16)]| {
            let head = word(row[0].0, row.len() as u16);
            let entries = row.iter().map(|e| word(e.1, e.2.cast_unsigned()));
            core::iter::once(head)
                .chain(entries)
                .flatten()
                .collect::<Vec<u8>>()
        };
        by_row.flat_map(row).collect()
    }

    fn basis(&self) -> Basis {
        Basis::new(Grid::new(self.rows, self.cols).expect("a small grid"))
    }
}

/// Values small enough that a row of them cannot overflow.
fn case() -> impl Strategy<Value = Case> {
    (1_u16..=9, 1_u16..=9).prop_flat_map(|(rows, cols)| {
        let cells = rows * cols;
        let entry = (0..cells, 0..cells, -800_i16..=800);
        let light = prop_oneof![Just(0_u16), Just(1 << 15), 0..=1_u16 << 15];
        (
            prop::collection::vec(entry, 1..200),
            prop::collection::vec(8_u8..=20, usize::from(cells)),
            prop::collection::vec([light.clone(), light.clone(), light], usize::from(cells)),
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

fn operator<'a>(
    case: &'a Case,
    basis: &Basis,
    bytes: &'a [u8],
) -> Result<Operator<'a>, OperatorError> {
    let segment = Segment::new(0, 1, Channels::All, bytes)?;
    let segments = core::iter::once(segment).collect();
    Operator::new(basis, segments, &case.shifts, [U1F15::ONE; 3])
}

proptest! {
    #[test]
    fn corrections_equal_those_of_the_dense_operator_within_rounding(case in case()) {
        let (basis, bytes) = (case.basis(), case.bytes());
        let operator = operator(&case, &basis, &bytes).expect("values are small enough");
        let count = basis.grid().cells();
        let (mut cells, mut scratch) = (vec![0; count], vec![0; count]);
        let mut inputs = vec![[0; 3]; count];
        let mut sums = vec![[0; 3]; count];
        for channel in 0..3 {
            for (cell, light) in cells.iter_mut().zip(&case.frame) {
                *cell = i32::from(light[channel]);
            }
            analyse_rounded(&basis, &mut cells, &mut scratch, &mut inputs, channel).expect("sized");
        }
        operator.apply(1, &inputs, &mut sums);

        let functions: Vec<_> = basis.functions().collect();
        let at = |f: &crate::haar::Function, cell: usize| {
            f.at(cell / basis.grid().cols(), cell % basis.grid().cols()) as f64
        };
        for channel in 0..3 {
            let mut corrections = vec![0; count];
            synthesise(&basis, &sums, channel, &mut corrections, &mut scratch).expect("sized");
            let light = |cell: usize| f64::from(case.frame[cell][channel]);
            let mut exact = vec![0.0; count];
            let mut tolerance = vec![0.0; count];
            for (row, function) in functions.iter().enumerate() {
                let unit = f64::from(case.shifts[row]).exp2();
                let (mut sum, mut slack) = (0.0, 0.0);
                for entry in case.entries.iter().filter(|e| usize::from(e.0) == row) {
                    let input = &functions[usize::from(entry.1)];
                    let h: f64 = (0..count).map(|cell| at(input, cell) * light(cell)).sum();
                    sum += f64::from(entry.2) * h / f64::from(input.input_shift()).exp2();
                    // An input coefficient is rounded to nearest.
                    slack += 0.5 * f64::from(entry.2.unsigned_abs());
                }
                for cell in 0..count {
                    exact[cell] += sum / unit * at(function, cell);
                    // The end of the row rounds once more.
                    tolerance[cell] += (slack / unit + 0.5) * at(function, cell).abs();
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
    fn any_bytes_make_an_operator_or_an_error(
        bytes in prop::collection::vec(any::<u8>(), 0..400), shifts in prop::collection::vec(0_u8..40, 12)
    ) {
        let basis = Basis::new(Grid::new(3, 4).expect("a small grid"));
        if let Ok(segment) = Segment::new(0, 1, Channels::One(2), &bytes) {
            let segments = core::iter::once(segment).collect();
            if let Ok(operator) = Operator::new(&basis, segments, &shifts, [U1F15::ONE; 3]) {
                operator.apply(1, &[[i16::MAX; 3]; 12], &mut [[0; 3]; 12]);
            }
        }
    }
}

/// One row of a 1 x 4 grid with these values.
fn row_of(values: &[i16], shift: u8) -> Case {
    Case {
        rows: 1,
        cols: 4,
        entries: (0..)
            .zip(values)
            .map(|(index, value)| (2, index, *value))
            .collect(),
        shifts: vec![shift; 4],
        frame: vec![[0; 3]; 4],
    }
}

#[test]
fn an_operator_at_the_edge_of_the_proof_is_taken_and_one_beyond_is_refused() {
    // 2^14 times the magnitudes, plus the half of the shift, must fit 2^31 - 1.
    let edge = row_of(&[i16::MAX, i16::MAX, i16::MAX, i16::MAX], 8);
    let (basis, bytes) = (edge.basis(), edge.bytes());
    let operator = operator(&edge, &basis, &bytes).expect("131,068 * 2^14 fits");
    assert_eq!(operator.bounds().accumulator, 131_068 << 14);
    let mut sums = [[0; 1]; 4];
    operator.apply(1, &[[1 << 14]; 4], &mut sums);
    assert_eq!(sums[2][0], (131_068 << 14) >> 8);
    operator.apply(1, &[[-(1 << 14)]; 4], &mut sums);
    assert_eq!(sums[2][0], -((131_068 << 14) >> 8));

    let beyond = row_of(&[i16::MIN, i16::MIN, i16::MIN, i16::MIN], 8);
    let bytes = beyond.bytes();
    let refused = super::tests::operator(&beyond, &basis, &bytes).expect_err("2^31 does not fit");
    assert!(matches!(
        refused,
        OperatorError::AccumulatorOverflow { row: 2, .. }
    ));
}

#[test]
fn a_correction_that_could_leave_its_type_is_refused() {
    let case = row_of(&[i16::MAX, i16::MAX, i16::MAX], 0);
    let (basis, bytes) = (case.basis(), case.bytes());
    let refused = operator(&case, &basis, &bytes).expect_err("98,301 * 2^14 is above 2^30");
    assert!(matches!(refused, OperatorError::CorrectionOverflow { .. }));
}

#[test]
fn malformed_rows_are_refused_with_their_place() {
    let basis = Basis::new(Grid::new(1, 4).expect("a small grid"));
    let check = |words: &[[u8; 4]]| {
        let bytes: Vec<u8> = words.concat();
        let segments = core::iter::once(Segment::new(0, 1, Channels::All, &bytes)?).collect();
        Operator::new(&basis, segments, &[20; 4], [U1F15::ONE; 3]).map(|_| ())
    };
    let malformed = |row| Err(OperatorError::Row { segment: 0, row });
    let entry = word(0, 1);
    assert_eq!(check(&[word(1, 0)]), malformed(1), "an empty row");
    assert_eq!(
        check(&[word(1, 2), entry]),
        malformed(1),
        "a row longer than its segment"
    );
    assert_eq!(
        check(&[word(4, 1), entry]),
        malformed(4),
        "a row beyond the grid"
    );
    let twice = [word(1, 1), entry, word(1, 1), entry];
    assert_eq!(check(&twice), malformed(1), "a row that comes twice");
    let bad_index = Err(OperatorError::Index { segment: 0, row: 1 });
    assert_eq!(
        check(&[word(1, 1), word(4, 1)]),
        bad_index,
        "an index beyond the grid"
    );
    assert_eq!(
        check(&[word(1, 2), entry, entry]),
        bad_index,
        "an index that comes twice"
    );
    assert_eq!(check(&[word(1, 1), entry]), Ok(()));
}

#[test]
fn a_channel_segment_and_a_channel_scale_touch_that_channel_only() {
    let basis = Basis::new(Grid::new(1, 4).expect("a small grid"));
    let bytes = [word(0, 1), word(3, 64)].concat();
    let segments =
        core::iter::once(Segment::new(0, 1, Channels::One(1), &bytes).expect("whole words"));
    let half = U1F15::from_num(0.5);
    let operator = Operator::new(
        &basis,
        segments.collect(),
        &[4; 4],
        [U1F15::ONE, half, U1F15::ONE],
    )
    .expect("well-formed");
    let mut sums = [[7; 3]; 4];
    operator.apply(1, &[[100, 100, 100]; 4], &mut sums);
    assert_eq!(sums[0], [0, 64 * 100 / 16 / 2, 0]);
    operator.apply(0, &[[100, 100, 100]; 4], &mut sums);
    assert_eq!(sums, [[0; 3]; 4], "tier 0 has no entries");
    assert_eq!(operator.cost(1, 3), (1, 1));
}
