//! Matrices as Python hands them over: the bytes of single-precision numbers, row by row.

use pyo3::prelude::*;

use crate::errors::data;

/// A matrix of finite numbers.
pub(crate) struct Matrix {
    values: Vec<f32>,
    width: usize,
}

impl Matrix {
    /// Reads rows of `width` numbers each.
    pub(crate) fn read(bytes: &[u8], width: usize) -> PyResult<Self> {
        if width == 0 || !bytes.len().is_multiple_of(4 * width) {
            return Err(data(format!(
                "{} bytes are not rows of {width} single-precision numbers",
                bytes.len()
            )));
        }
        let values: Vec<f32> = bytes
            .chunks_exact(4)
            .map(|four| f32::from_ne_bytes([four[0], four[1], four[2], four[3]]))
            .collect();
        check_finite(&values, width)?;
        Ok(Self { values, width })
    }

    pub(crate) fn rows(&self) -> impl ExactSizeIterator<Item = &[f32]> + Clone {
        self.values.chunks_exact(self.width)
    }
}

/// Whether all numbers of these rows are finite.
pub(crate) fn check_finite(values: &[f32], width: usize) -> PyResult<()> {
    match values.iter().position(|x| !x.is_finite()) {
        Some(place) => Err(data(format!(
            "feature {} of sample {} is not finite in single precision",
            place % width.max(1),
            place / width.max(1)
        ))),
        None => Ok(()),
    }
}

/// The bytes of double-precision numbers.
pub(crate) fn doubles(values: &[f64]) -> Vec<u8> {
    values.iter().flat_map(|value| value.to_ne_bytes()).collect()
}
