//! Payloads of frames, as each side reads them.

use iltm_runtime::link::{Event, MAX_PAYLOAD, Request, Response};
use serde::{Deserialize, Serialize};
use std::fmt::Debug;

/// A payload as a request, a response and an event.
///
/// # Panics
/// If a message that was read does not fit a frame, or is read as another one after
/// it was written again.
pub fn messages(bytes: &[u8]) {
    let bytes = &bytes[..bytes.len().min(MAX_PAYLOAD)];
    if let Ok(request) = Request::parse(bytes) {
        again(&request, |bytes| {
            assert_eq!(Request::parse(bytes), Ok(request), "written and read again");
        });
    }
    both_ways::<Response>(bytes);
    both_ways::<Event>(bytes);
}

fn both_ways<M: Serialize + for<'a> Deserialize<'a> + PartialEq + Debug>(bytes: &[u8]) {
    if let Ok(message) = postcard::from_bytes::<M>(bytes) {
        again(&message, |bytes| {
            let read = postcard::from_bytes::<M>(bytes);
            assert_eq!(read.as_ref(), Ok(&message), "written and read again");
        });
    }
}

fn again<M: Serialize + Debug>(message: &M, read: impl FnOnce(&[u8])) {
    let mut bytes = [0; MAX_PAYLOAD];
    match postcard::to_slice(message, &mut bytes) {
        Ok(bytes) => read(bytes),
        // Bytes of a chunk are what a payload has room for; a message as long as the
        // payload that it was read from fits again.
        Err(error) => panic!("{message:?} does not fit a frame: {error}"),
    }
}
