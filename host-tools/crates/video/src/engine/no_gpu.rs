//! Without the feature `gpu` there is no graphics processor.

use super::super::VideoError;

/// A graphics processor: none.
#[derive(Debug)]
pub(in super::super) enum Gpu {}

impl Gpu {
    /// # Errors
    /// [`VideoError::WithoutGpu`]
    pub(in super::super) const fn find() -> Result<Self, VideoError> {
        Err(VideoError::WithoutGpu)
    }

    pub(in super::super) const fn name(&self) -> &str {
        match *self {}
    }
}
