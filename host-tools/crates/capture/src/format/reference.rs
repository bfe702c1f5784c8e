//! Reference transport: `reference_T.npy`, the transport itself where somebody measured it.
//!
//! A capture folder may hold `T` measured one light at a time, or rendered: a `NumPy`
//! array of 32- or 64-bit floats, `N x N` for a grey capture, `3 x N x N` for one in
//! colour, camera units, ambient light removed. Nothing is solved from it; it only says
//! how far a solve is off.

use super::manifest::read_small;
use iltm_picture::npy::{FloatArray, MOST_HEADER};
use iltm_runtime::Grid;
use nalgebra::DMatrix;
use std::path::{Path, PathBuf};

/// Its name in a capture folder.
pub const REFERENCE_FILE: &str = "reference_T.npy";

/// Why a reference cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum ReferenceError {
    /// The file could not be read.
    #[error("{}: {source}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// What the operating system says.
        source: std::io::Error,
    },
    /// The bytes are not a `NumPy` array of floats, or end before it does.
    #[error("{}: not a NumPy array of 32- or 64-bit floats: {reason}", path.display())]
    Format {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        reason: String,
    },
    /// The array is not one square matrix a channel.
    #[error(
        "{}: the array is {given}; for this capture it has to be {wanted}",
        path.display()
    )]
    Shape {
        /// The file.
        path: PathBuf,
        /// Its shape.
        given: String,
        /// What the grid and the channels ask for.
        wanted: String,
    },
    /// An element is NaN or infinite.
    #[error(
        "{}: what cell {row} receives of cell {col} in channel {channel} is not a finite number",
        path.display()
    )]
    NotFinite {
        /// The file.
        path: PathBuf,
        /// Channel.
        channel: usize,
        /// Observed cell.
        row: usize,
        /// Lit cell.
        col: usize,
    },
}

impl ReferenceError {
    /// What to do about it.
    #[must_use]
    pub const fn next_step(&self) -> &'static str {
        match self {
            Self::Io { .. } => "Check the permissions of the file.",
            Self::Format { .. } | Self::Shape { .. } | Self::NotFinite { .. } => {
                "Save it again with numpy.save, or move it out of the capture: it is not needed."
            }
        }
    }
}

/// The reference of a capture, `N x N` for each channel; `None` if it has none.
///
/// # Errors
/// [`ReferenceError`] if there is one that cannot be used.
pub fn read_reference(
    folder: &Path,
    grid: Grid,
    channels: usize,
) -> Result<Option<Vec<DMatrix<f64>>>, ReferenceError> {
    let path = folder.join(REFERENCE_FILE);
    let failed = |source| ReferenceError::Io {
        path: path.clone(),
        source,
    };
    let cells = grid.cells() as u64;
    let most = MOST_HEADER as u64 + 8 * cells * cells * channels as u64;
    // One byte more than fits: a longer file has another shape.
    let bytes = read_small(&path, most).map_err(failed)?;
    bytes
        .map(|bytes| parse_reference(&bytes, grid, channels, &path))
        .transpose()
}

/// The same from the bytes of a file called `path`.
///
/// # Errors
/// [`ReferenceError`] if they are not such an array.
pub fn parse_reference(
    bytes: &[u8],
    grid: Grid,
    channels: usize,
    path: &Path,
) -> Result<Vec<DMatrix<f64>>, ReferenceError> {
    let array = FloatArray::read(bytes).map_err(|reason| ReferenceError::Format {
        path: path.to_owned(),
        reason,
    })?;
    let cells = grid.cells();
    let wanted = match channels {
        1 => vec![cells, cells],
        _ => vec![channels, cells, cells],
    };
    if array.shape != wanted {
        return Err(ReferenceError::Shape {
            path: path.to_owned(),
            given: shape(&array.shape),
            wanted: shape(&wanted),
        });
    }
    let mut transports = Vec::new();
    for (channel, values) in array.values.chunks_exact(cells * cells).enumerate() {
        let transport = DMatrix::from_row_slice(cells, cells, values);
        if let Some(at) = transport.iter().position(|value| !value.is_finite()) {
            return Err(ReferenceError::NotFinite {
                path: path.to_owned(),
                channel,
                row: at % cells,
                col: at / cells,
            });
        }
        transports.push(transport);
    }
    Ok(transports)
}

fn shape(sides: &[usize]) -> String {
    let sides: Vec<String> = sides.iter().map(usize::to_string).collect();
    match sides.len() {
        0 => "a single number".to_owned(),
        1 => format!("a list of {}", sides[0]),
        _ => sides.join(" x "),
    }
}

#[cfg(test)]
mod tests {
    use super::ReferenceError as Error;
    use super::*;
    use npyz::{Order, WriterBuilder};

    fn parse(bytes: &[u8], cells: u16, channels: usize) -> Result<Vec<DMatrix<f64>>, Error> {
        let grid = Grid::new(1, cells).unwrap();
        parse_reference(bytes, grid, channels, Path::new(REFERENCE_FILE))
    }

    fn npy<T: npyz::AutoSerialize>(shape: &[u64], order: Order, values: Vec<T>) -> Vec<u8> {
        let mut bytes = Vec::new();
        let writer = npyz::WriteOptions::new().default_dtype().shape(shape);
        let mut writer = writer.order(order).writer(&mut bytes).begin_nd().unwrap();
        writer.extend(values).unwrap();
        writer.finish().unwrap();
        bytes
    }

    #[test]
    fn rows_are_what_cells_receive_in_either_order_and_width() {
        let by_rows = npy(&[2, 2], Order::C, vec![1.0_f64, 2.0, 3.0, 4.0]);
        let by_columns = npy(&[2, 2], Order::Fortran, vec![1.0_f32, 3.0, 2.0, 4.0]);
        let expected = DMatrix::from_row_slice(2, 2, &[1.0, 2.0, 3.0, 4.0]);
        for bytes in [by_rows, by_columns] {
            assert_eq!(parse(&bytes, 2, 1).unwrap()[0], expected);
        }
    }

    #[test]
    fn colour_has_a_matrix_for_each_channel_in_either_order() {
        let value =
            |channel: usize, row: usize, col: usize| (100 * channel + 10 * row + col) as f64;
        let by_rows = (0..12)
            .map(|at| value(at / 4, at / 2 % 2, at % 2))
            .collect();
        let by_columns = (0..12)
            .map(|at| value(at % 3, at / 3 % 2, at / 6))
            .collect();
        for bytes in [
            npy(&[3, 2, 2], Order::C, by_rows),
            npy(&[3, 2, 2], Order::Fortran, by_columns),
        ] {
            let read = parse(&bytes, 2, 3).unwrap();
            assert_eq!(
                read[2],
                DMatrix::from_fn(2, 2, |row, col| value(2, row, col))
            );
        }
    }

    #[test]
    fn another_shape_is_named_with_the_one_that_is_wanted() {
        let bytes = npy(&[4], Order::C, vec![0.0_f32; 4]);
        let flaw = parse(&bytes, 2, 1).unwrap_err();
        assert!(
            matches!(flaw, Error::Shape { given, wanted, .. } if given == "a list of 4" && wanted == "2 x 2")
        );
        let bytes = npy(&[2, 2], Order::C, vec![0.0_f32; 4]);
        assert!(matches!(parse(&bytes, 2, 3), Err(Error::Shape { .. })));
    }

    #[test]
    fn an_element_that_is_not_finite_is_named_with_its_cells() {
        let bytes = npy(&[2, 2], Order::C, vec![0.0, f64::NAN, 0.0, 0.0]);
        assert!(matches!(
            parse(&bytes, 2, 1),
            Err(Error::NotFinite {
                channel: 0,
                row: 0,
                col: 1,
                ..
            })
        ));
    }

    #[test]
    fn integers_and_damaged_bytes_are_refused_without_a_panic() {
        let whole = npy(&[2, 2], Order::C, vec![1_i32; 4]);
        assert!(matches!(parse(&whole, 2, 1), Err(Error::Format { .. })));
        let good = npy(&[2, 2], Order::C, vec![1.0_f64; 4]);
        for length in 0..good.len() {
            assert!(parse(&good[..length], 2, 1).is_err(), "{length} bytes");
        }
    }

    #[test]
    fn a_header_that_claims_gigabytes_or_nests_without_end_is_refused() {
        let mut bytes = npy(&[2, 2], Order::C, vec![1.0_f64; 4]);
        bytes[6] = 2;
        bytes[8..12].copy_from_slice(&[255; 4]);
        assert!(matches!(parse(&bytes, 2, 1), Err(Error::Format { .. })));
        let mut nested = b"\x93NUMPY\x01\x00\x00\x10".to_vec();
        nested.extend([b'('; 4_096]);
        assert!(matches!(parse(&nested, 2, 1), Err(Error::Format { .. })));
    }
}
