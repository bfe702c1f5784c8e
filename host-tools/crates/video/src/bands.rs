//! What frames of all layouts have in common: rows that can be spread over
//! threads and turned into separate colours.

use super::curves::Code;

/// Rows that are turned into colours together: a row of 4:2:0 chroma has two.
pub(super) const STRIP: usize = 2;

/// A frame whose rows can be worked on by several threads.
pub(super) trait Bands: Send {
    /// Its samples.
    type Code: Code;
    /// Some adjacent rows.
    type Band<'b>: Band<Code = Self::Code, Memory = Self::Memory>
    where
        Self: 'b;
    /// What a thread needs to convert rows.
    type Memory: Default + Send;

    /// Cuts the frame into bands of `rows` rows, the last one shorter; `rows` is a
    /// multiple of [`STRIP`].
    fn bands(&mut self, rows: usize) -> Vec<Self::Band<'_>>;
}

/// Some adjacent rows of a frame, from an even one on.
pub(super) trait Band: Send + Sync {
    /// Its samples.
    type Code: Code;
    /// What a thread needs to convert rows.
    type Memory: Default + Send;

    /// How many rows there are.
    fn rows(&self) -> usize;

    /// Separates the colours of one strip. `colours` has one row of codes after
    /// the other: the first row's colours, then the second's.
    fn unpack(&self, strip: usize, memory: &mut Self::Memory, colours: &mut [Self::Code]);

    /// Puts the colours of one strip, in the same order, back into the frame.
    fn pack(&mut self, strip: usize, memory: &mut Self::Memory, colours: &[Self::Code]);
}
