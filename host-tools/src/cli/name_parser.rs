//! Completions of values that have names: a value is read by its own rule, and its names are
//! listed for shells.

use clap::builder::{PossibleValue, StringValueParser, TypedValueParser};
use clap::{Arg, Command, Error};
use std::error::Error as StdError;
use std::ffi::OsStr;
use std::marker::PhantomData;
use std::str::FromStr;

/// Reads values of `T`.
#[derive(Debug)]
pub(super) struct NameParser<T> {
    names: Vec<&'static str>,
    of: PhantomData<fn() -> T>,
}

// A derived one would ask it of `T`.
impl<T> Clone for NameParser<T> {
    fn clone(&self) -> Self {
        Self::new(self.names.iter().copied())
    }
}

impl<T> NameParser<T> {
    pub(super) fn new(names: impl IntoIterator<Item = &'static str>) -> Self {
        Self {
            names: names.into_iter().collect(),
            of: PhantomData,
        }
    }
}

impl<T> TypedValueParser for NameParser<T>
where
    T: FromStr<Err: Into<Box<dyn StdError + Send + Sync>>> + Clone + Send + Sync + 'static,
{
    type Value = T;

    fn parse_ref(&self, command: &Command, arg: Option<&Arg>, value: &OsStr) -> Result<T, Error> {
        let parser = StringValueParser::new().try_map(|name| name.parse());
        parser.parse_ref(command, arg, value)
    }

    fn possible_values(&self) -> Option<Box<dyn Iterator<Item = PossibleValue> + '_>> {
        Some(Box::new(self.names.iter().map(PossibleValue::new)))
    }
}
