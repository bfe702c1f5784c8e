//! Operator errors: why operator entries are refused.

use core::fmt;

/// Why operator entries cannot be used.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
#[non_exhaustive]
pub enum OperatorError {
    /// There are more segments than a table may have.
    Segments,
    /// A group of rows is empty, out of order, or longer than its segment.
    Group {
        /// Index of the segment.
        segment: usize,
    },
    /// A channel's scale is above 1.
    ChannelScale,
    /// A segment's bytes are not whole words.
    Words {
        /// Index of the segment.
        segment: usize,
    },
    /// A row is beyond the grid, out of order, in two groups, in the wrong one,
    /// longer than its segment, or shifted by a number of bits that there cannot be.
    Row {
        /// Index of the segment.
        segment: usize,
        /// Row of the operator.
        row: usize,
    },
    /// An entry's index is beyond the grid or out of order.
    Index {
        /// Index of the segment.
        segment: usize,
        /// Row of the operator.
        row: usize,
    },
    /// Some frame could make a row's sum leave 32 bits.
    AccumulatorOverflow {
        /// Row of the operator.
        row: usize,
        /// Largest magnitude that the sum can reach.
        bound: u64,
    },
    /// Some frame could make a correction leave its type.
    CorrectionOverflow {
        /// Largest magnitude that a correction can reach, in units of 2^-23.
        bound: u64,
    },
    /// The bounds in the image are not those of its entries.
    BoundsDiffer,
    /// The costs in the image are not those of its entries.
    CostDiffers {
        /// The tier.
        tier: u8,
    },
}

impl fmt::Display for OperatorError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Segments => f.write_str("it has too many segments"),
            Self::Group { segment } => {
                write!(f, "a group of rows in segment {segment} is malformed")
            }
            Self::ChannelScale => f.write_str("a channel's scale is above 1"),
            Self::Words { segment } => write!(f, "segment {segment} ends within a word"),
            Self::Row { segment, row } => {
                write!(f, "row {row} in segment {segment} is malformed")
            }
            Self::Index { segment, row } => write!(
                f,
                "row {row} in segment {segment} has an index beyond the grid or out of order"
            ),
            Self::AccumulatorOverflow { row, bound } => write!(
                f,
                "a frame could make row {row} overflow: its sum can reach {bound}"
            ),
            Self::CorrectionOverflow { bound } => write!(
                f,
                "a frame could make a correction overflow: it can reach {bound} / 2^23"
            ),
            Self::BoundsDiffer => {
                f.write_str("the stated overflow bounds are not those of its entries")
            }
            Self::CostDiffers { tier } => write!(
                f,
                "the stated cost of tier {tier} is not that of its entries"
            ),
        }
    }
}

impl core::error::Error for OperatorError {}
