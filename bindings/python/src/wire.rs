//! What travels, between bytes and JSON.

use gestalt_mind::envelope;
use gestalt_protocol::{DecodeError, FrameHeader, FrameTaken, decode_json};
use pyo3::prelude::*;
use pyo3::types::PyBytes;
use serde_json::to_string;

use crate::errors::decode;

#[pyfunction]
pub(crate) fn decode_envelope(payload: &[u8]) -> PyResult<String> {
    envelope::to_json(payload).map_err(decode)
}

#[pyfunction]
pub(crate) fn encode_envelope<'py>(py: Python<'py>, json: &str) -> PyResult<Bound<'py, PyBytes>> {
    Ok(PyBytes::new(py, &envelope::from_json(json.as_bytes()).map_err(decode)?))
}

#[pyfunction]
pub(crate) fn decode_frame_header(payload: &[u8]) -> PyResult<String> {
    to_string(&FrameHeader::decode(payload).map_err(decode)?).map_err(decode)
}

#[pyfunction]
pub(crate) fn encode_frame_header<'py>(py: Python<'py>, json: &str) -> PyResult<Bound<'py, PyBytes>> {
    let header: FrameHeader = decode_json(json.as_bytes()).map_err(decode)?;
    let bytes = header.encode();
    FrameHeader::decode(&bytes).map_err(decode)?;
    Ok(PyBytes::new(py, &bytes))
}

#[pyfunction]
pub(crate) fn decode_frame_taken(payload: &[u8]) -> PyResult<String> {
    to_string(&FrameTaken::decode(payload).map_err(decode)?).map_err(decode)
}

#[pyfunction]
pub(crate) fn encode_frame_taken<'py>(py: Python<'py>, json: &str) -> PyResult<Bound<'py, PyBytes>> {
    let taken: Result<FrameTaken, DecodeError> = decode_json(json.as_bytes());
    Ok(PyBytes::new(py, &taken.map_err(decode)?.encode()))
}
