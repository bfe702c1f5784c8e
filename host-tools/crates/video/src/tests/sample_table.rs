//! Tables made up for tests and benches: gains, ambient light and operators that
//! exercise every stage, without a scene behind them.
//!
//! The bench includes this file too, so it takes the writer from its parent.

use super::{ImageWriter, StoredRow, response_codes, segment_bytes};
use fixed::types::{U0F32, U1F15, U8F24};
use iltm_runtime::{
    Grid,
    haar::Basis,
    image::{Meta, TierInfo, layout::SectionKind},
    operator::{Bounds, Channels, Operator, Segment},
    response::{RESPONSE_KNOTS, knot_drive},
};

/// What a table is to hold.
#[derive(Clone)]
pub(crate) struct SampleTable {
    pub(crate) grid: Grid,
    pub(crate) channels: usize,
    /// Of every cell and channel.
    pub(crate) gain_fraction: u8,
    pub(crate) gains: Vec<u16>,
    pub(crate) ambient: Option<Vec<u16>>,
    pub(crate) response: Option<Vec<u16>>,
    /// Rows, columns, gains.
    pub(crate) fine_gains: Option<(u16, u16, Vec<u16>)>,
    /// Of every operator row; none without an operator.
    pub(crate) row_shifts: Vec<u8>,
    /// Row, column, value of the entries that each tier above 0 adds.
    pub(crate) tiers: Vec<Vec<(u16, u16, i16)>>,
    pub(crate) channel_scales: [U1F15; 3],
}

impl SampleTable {
    /// Gain 1, and nothing else.
    pub(crate) fn identity(grid: Grid, channels: usize) -> Self {
        let mut channel_scales = [U1F15::ZERO; 3];
        channel_scales[..channels].fill(U1F15::ONE);
        Self {
            grid,
            channels,
            gain_fraction: 12,
            gains: vec![1 << 12; grid.cells() * channels],
            ambient: None,
            response: None,
            fine_gains: None,
            row_shifts: Vec::new(),
            tiers: Vec::new(),
            channel_scales,
        }
    }

    /// Gains between .7 and 1.3, some ambient light, a response like sRGB, fine
    /// gains four times finer than the cells, and an operator of two tiers with
    /// `entries` entries a row.
    pub(crate) fn random(grid: Grid, channels: usize, entries: usize, seed: u64) -> Self {
        let mut random = fastrand::Rng::with_seed(seed);
        let mut gains = |cells: usize| -> Vec<u16> {
            let gain = || ((0.7 + 0.6 * random.f64()) * 4096.0) as u16;
            std::iter::repeat_with(gain)
                .take(cells * channels)
                .collect()
        };
        let (fine_rows, fine_cols) = (4 * grid.rows(), 4 * grid.cols());
        let mut table = Self::identity(grid, channels);
        table.gains = gains(grid.cells());
        table.fine_gains = Some((
            fine_rows as u16,
            fine_cols as u16,
            gains(fine_rows * fine_cols),
        ));
        let ambient = || random.u16(0..600);
        table.ambient = Some(
            std::iter::repeat_with(ambient)
                .take(table.gains.len())
                .collect(),
        );
        table.response = Some(srgb_response());
        if channels == 3 {
            table.channel_scales[1] = U1F15::from_num(0.9);
        }
        let basis = Basis::new(grid);
        table.row_shifts = vec![6; grid.cells()];
        table.tiers = vec![Vec::new(); 2];
        // A single cell lights no other.
        let rows = if grid.cells() > 1 { grid.cells() } else { 0 };
        for (row, function) in basis.functions().enumerate().take(rows) {
            let most = (12_000 / function.peak() / entries as u64).max(1) as i16;
            let mut cols: Vec<u16> = (0..entries)
                .map(|_| random.u16(..grid.cells() as u16))
                .collect();
            cols.sort_unstable();
            cols.dedup();
            for col in cols {
                let value = random.i16(-most..=most);
                table.tiers[usize::from(random.bool())].push((row as u16, col, value));
            }
        }
        table
    }

    /// The bytes of the image.
    pub(crate) fn image(&self) -> Vec<u8> {
        let segments: Vec<Vec<u8>> = (1..=self.tiers.len())
            .map(|tier| self.words(tier))
            .collect();
        let basis = Basis::new(self.grid);
        let operator = (!self.row_shifts.is_empty()).then(|| {
            let segments = (1..).zip(&segments).map(|(tier, bytes)| {
                let index = usize::from(tier) - 1;
                Segment::new(index, tier, Channels::All, bytes).expect("whole words")
            });
            Operator::new(&basis, segments.collect(), self.channel_scales)
                .expect("a sample operator does not overflow")
        });
        let mut writer = ImageWriter::default();
        writer.section(
            SectionKind::Meta,
            0,
            self.meta(operator.as_ref()).emit().to_vec(),
        );
        let tiers = (0..=self.tiers.len() as u8).flat_map(|number| {
            let cost = operator.as_ref().map_or((0, 0), |operator| {
                operator.cost(number, self.channels as u8)
            });
            TierInfo {
                predicted_error: U0F32::ZERO,
                entries: cost.0,
                multiplications: cost.1,
            }
            .emit()
        });
        writer.section(SectionKind::Tiers, 0, tiers.collect());
        writer.section(SectionKind::Gain, 0, halfwords(&self.gains));
        if let Some(ambient) = &self.ambient {
            writer.section(SectionKind::Ambient, 0, halfwords(ambient));
        }
        if let Some(response) = &self.response {
            writer.section(SectionKind::Response, 0, halfwords(response));
            writer.section(SectionKind::Codes, 0, response_codes(response));
        }
        if let Some((rows, cols, gains)) = &self.fine_gains {
            let bytes = [halfwords(&[*rows, *cols]), halfwords(gains)].concat();
            writer.section(SectionKind::FineGain, 0, bytes);
        }
        if operator.is_some() {
            for (selector, bytes) in (1..).zip(segments.clone()) {
                writer.section(SectionKind::Operator, selector, bytes);
            }
        }
        writer.finish()
    }

    /// The segment of a tier: its own entries and those of the tiers below.
    fn words(&self, tier: usize) -> Vec<u8> {
        let mut entries: Vec<_> = self.tiers[..tier].concat();
        entries.sort_unstable();
        let rows = entries.chunk_by(|a, b| a.0 == b.0).map(|row| StoredRow {
            index: row[0].0,
            shift: self.row_shifts[usize::from(row[0].0)].into(),
            entries: row.iter().map(|(_, col, value)| (*col, *value)).collect(),
        });
        segment_bytes(self.grid.cells(), &rows.collect::<Vec<_>>())
    }

    fn meta(&self, operator: Option<&Operator<'_>>) -> Meta {
        Meta {
            grid: self.grid,
            channels: self.channels as u8,
            gain_fraction: self.gain_fraction,
            reference_white: U8F24::from_bits(1 << 23),
            inverse_error: U0F32::ZERO,
            bounds: operator.map_or(Bounds::default(), Operator::bounds),
            channel_scales: self.channel_scales,
        }
    }
}

/// Codes of a projector that undoes sRGB.
pub(crate) fn srgb_response() -> Vec<u16> {
    let code = |knot: usize| {
        let drive = knot_drive(knot).to_num::<f64>();
        let value = if drive <= 0.003_130_8 {
            12.92 * drive
        } else {
            1.055 * drive.powf(1.0 / 2.4) - 0.055
        };
        (value * 65_535.0).round() as u16
    };
    (0..RESPONSE_KNOTS).map(code).collect()
}

fn halfwords(values: &[u16]) -> Vec<u8> {
    values
        .iter()
        .flat_map(|value| value.to_le_bytes())
        .collect()
}
