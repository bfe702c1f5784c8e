//! Command line as a user meets it: `iltm` is run, and what it says, its exit code and the
//! files that it leaves behind are looked at. One module for a command or a task: `cargo
//! test -p iltm --test command simulate` runs the tests of one.

mod check;
mod cli;
mod compare;
mod desktop;
mod device;
mod emulate;
mod export;
mod flash;
mod images;
#[cfg(target_os = "linux")]
mod interruption;
mod join;
mod live;
mod play;
mod schema;
mod session;
mod simulate;
mod table_words;
mod tradeoff;
mod user;
mod verify;
mod verify_several;
