//! `NumPy` files (`.npy`): arrays of floats, read and written.
//!
//! The format is [NEP 1](https://numpy.org/neps/nep-0001-npy-format.html): a header that is
//! a Python dictionary, then the elements.

/// Bytes of a header that are read; `NumPy` writes 118 for an array of two axes.
pub const MOST_HEADER: usize = 4_096;

const MAGIC: &[u8] = b"\x93NUMPY";

/// An array of floats.
#[derive(Clone, PartialEq, Debug)]
pub struct FloatArray {
    /// Length of each axis; none for a single number.
    pub shape: Vec<usize>,
    /// The elements, the last axis fastest.
    pub values: Vec<f64>,
}

impl FloatArray {
    /// Reads an array of 32- or 64-bit floats in either byte order and either order of axes.
    ///
    /// # Errors
    /// A sentence that says why the bytes are none.
    ///
    /// # Fuzzing
    /// Total: any bytes give an array or an error, in memory of a few times their length.
    pub fn read(bytes: &[u8]) -> Result<Self, String> {
        let (header, elements) = split(bytes)?;
        let (shape, count) = shape(value(header, "shape")?)?;
        let by_columns = match value(header, "fortran_order")? {
            word if word.starts_with("True") => true,
            word if word.starts_with("False") => false,
            _ => return Err("its header does not say the order of its elements".to_owned()),
        };
        let descr = value(header, "descr")?.get(..5).unwrap_or_default();
        let elements: Vec<f64> = match descr.trim_matches(['\'', '"']) {
            "<f4" => decoded(elements, |bytes| f32::from_le_bytes(bytes).into()),
            ">f4" => decoded(elements, |bytes| f32::from_be_bytes(bytes).into()),
            "<f8" => decoded(elements, f64::from_le_bytes),
            ">f8" => decoded(elements, f64::from_be_bytes),
            _ => return Err("its elements are of another type".to_owned()),
        };
        if elements.len() < count {
            return Err(format!(
                "it ends after {} of {count} elements",
                elements.len()
            ));
        }
        let place = |at| {
            if by_columns {
                column_major(&shape, at)
            } else {
                at
            }
        };
        let values = (0..count).map(|at| elements[place(at)]).collect();
        Ok(Self { shape, values })
    }
}

/// A file of 32-bit floats, the last axis fastest.
///
/// # Panics
/// If there are more or fewer values than the axes say.
#[must_use]
pub fn write(shape: &[usize], values: &[f32]) -> Vec<u8> {
    assert_eq!(shape.iter().product::<usize>(), values.len());
    let sides: Vec<String> = shape.iter().map(|side| format!("{side}, ")).collect();
    let sides = sides.concat();
    let header = format!("{{'descr': '<f4', 'fortran_order': False, 'shape': ({sides}), }}");
    // Elements begin at a multiple of 64, after magic, version, length and a line's end.
    let length = (MAGIC.len() + 4 + header.len() + 1).next_multiple_of(64) - MAGIC.len() - 4;
    let mut bytes = MAGIC.to_vec();
    bytes.extend([1, 0]);
    bytes.extend((length as u16).to_le_bytes());
    bytes.extend(format!("{header:<width$}\n", width = length - 1).bytes());
    bytes.extend(values.iter().flat_map(|value| value.to_le_bytes()));
    bytes
}

/// Header and elements of a file.
fn split(bytes: &[u8]) -> Result<(&str, &[u8]), String> {
    let rest = bytes.strip_prefix(MAGIC).ok_or("it begins otherwise")?;
    let (length, rest) = match rest {
        [1, _, a, b, rest @ ..] => (u32::from(u16::from_le_bytes([*a, *b])), rest),
        [2 | 3, _, a, b, c, d, rest @ ..] => (u32::from_le_bytes([*a, *b, *c, *d]), rest),
        [_, _, _, _, ..] => return Err("its version is none that is known".to_owned()),
        _ => return Err("it ends within its header".to_owned()),
    };
    if length as usize > MOST_HEADER {
        return Err(format!("its header has {length} bytes"));
    }
    let (header, elements) = rest
        .split_at_checked(length as usize)
        .ok_or("it ends within its header")?;
    let header = std::str::from_utf8(header).map_err(|error| error.to_string())?;
    Ok((header, elements))
}

/// What follows a key of the header.
fn value<'h>(header: &'h str, key: &str) -> Result<&'h str, String> {
    let after = |quoted: String| Some(header.split_once(&quoted)?.1.trim_start());
    after(format!("'{key}':"))
        .or_else(|| after(format!("\"{key}\":")))
        .ok_or_else(|| format!("its header has no {key}"))
}

/// The axes of `(3, 4)`, `(3,)` or `()`, and how many elements they hold.
fn shape(value: &str) -> Result<(Vec<usize>, usize), String> {
    let inner = value
        .strip_prefix('(')
        .and_then(|rest| rest.split_once(')'));
    let sides = inner
        .map_or("?", |(inner, _)| inner)
        .split(',')
        .map(str::trim);
    let sides = sides.filter(|side| !side.is_empty());
    let sides: Result<Vec<usize>, _> = sides.map(str::parse).collect();
    let sides = sides.map_err(|_| "its shape is no list of numbers")?;
    let count = sides
        .iter()
        .try_fold(1_usize, |all, side| all.checked_mul(*side));
    let count = count.ok_or("its shape has more elements than a file")?;
    Ok((sides, count))
}

fn decoded<const N: usize>(bytes: &[u8], element: impl Fn([u8; N]) -> f64) -> Vec<f64> {
    let (elements, _) = bytes.as_chunks::<N>();
    elements.iter().copied().map(element).collect()
}

/// Where an element lies in a file with the first axis fastest.
fn column_major(shape: &[usize], mut at: usize) -> usize {
    let mut stride: usize = shape.iter().product();
    let mut place = 0;
    for side in shape.iter().rev() {
        stride /= side;
        place += at % side * stride;
        at /= side;
    }
    place
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What `numpy.save` writes.
    fn by_numpy(descr: &str, by_columns: &str, shape: &str, elements: &[u8]) -> Vec<u8> {
        let dictionary =
            format!("{{'descr': '{descr}', 'fortran_order': {by_columns}, 'shape': {shape}, }}");
        let mut bytes = b"\x93NUMPY\x01\x00\x76\x00".to_vec();
        bytes.extend(format!("{dictionary:<117}\n").bytes());
        bytes.extend(elements);
        bytes
    }

    #[test]
    fn either_order_of_axes_and_of_bytes_is_read() {
        let values: Vec<f64> = (0..6).map(f64::from).collect();
        let little: Vec<u8> = values
            .iter()
            .flat_map(|value| value.to_le_bytes())
            .collect();
        let read = FloatArray::read(&by_numpy("<f8", "False", "(2, 3)", &little)).unwrap();
        assert_eq!((read.shape, read.values), (vec![2, 3], values.clone()));
        let read = FloatArray::read(&by_numpy("<f8", "True", "(3, 2)", &little)).unwrap();
        assert_eq!(read.values, [0.0, 3.0, 1.0, 4.0, 2.0, 5.0]);
        let big: Vec<u8> = [0.5_f32, -2.0]
            .iter()
            .flat_map(|value| value.to_be_bytes())
            .collect();
        let read = FloatArray::read(&by_numpy(">f4", "False", "(2,)", &big)).unwrap();
        assert_eq!((read.shape, read.values), (vec![2], vec![0.5, -2.0]));
        let read = FloatArray::read(&by_numpy("<f8", "False", "()", &1.0_f64.to_le_bytes()));
        assert_eq!(read.unwrap().values, [1.0]);
    }

    #[test]
    fn what_is_written_is_read_back() {
        let values = [1.0_f32, 2.5, -3.0, 0.0, 7.0, 8.0];
        let bytes = write(&[3, 1, 2], &values);
        assert_eq!((bytes.len() - 24) % 64, 0, "elements are aligned");
        let read = FloatArray::read(&bytes).unwrap();
        assert_eq!(read.shape, [3, 1, 2]);
        assert_eq!(read.values, values.map(f64::from));
    }

    #[test]
    fn shapes_that_no_file_can_hold_are_refused() {
        for shape in [
            "(4294967296, 4294967296, 4)",
            "(-1,)",
            "(1",
            "[1]",
            "(1.0,)",
        ] {
            assert!(FloatArray::read(&by_numpy("<f8", "False", shape, &[0; 8])).is_err());
        }
        let none = FloatArray::read(&by_numpy("<f8", "True", "(0, 5)", &[])).unwrap();
        assert!(none.values.is_empty());
    }
}
