//! What can be typed.

use super::failure::Kind;
use crate::solve::Method;
use clap::{Args, Parser, Subcommand};
use std::path::PathBuf;

/// Cancels the light that bounces between the surfaces of a projection.
#[derive(Debug, Parser)]
#[command(name = "iltm", version, about, after_help = Kind::table())]
pub(super) struct Arguments {
    /// Print one JSON object on standard output and nothing else there
    #[arg(long, global = true)]
    pub(super) json: bool,
    #[command(subcommand)]
    pub(super) command: Command,
}

#[derive(Debug, Subcommand)]
pub(super) enum Command {
    /// Do the whole job without hardware: photographs, table, compensated video, report
    Demo(Demo),
    /// Learn a scene from its photographs and write its table
    Solve(Solve),
    /// Say what is in a table
    Inspect(Inspect),
    /// Compensate a picture or a video with a table
    Compensate(Compensate),
}

#[derive(Debug, Args)]
pub(super) struct Demo {
    /// Folder to write into; made if it is not there
    #[arg(long, value_name = "DIR", default_value = "iltm-demo")]
    pub(super) out: PathBuf,
}

#[derive(Debug, Args)]
pub(super) struct Solve {
    /// Folder with `capture.csv`, patterns and photographs
    pub(super) capture: PathBuf,
    /// Table to write
    #[arg(short, long, value_name = "TABLE.iltm")]
    pub(super) output: PathBuf,
    /// Use only the first M Bernoulli photographs beside all others
    #[arg(long, value_name = "M")]
    pub(super) photos: Option<usize>,
    /// How to find the inverse: `joint` (all channels and photographs, with what
    /// physics knows) or `direct` (the paper's plain l1)
    #[arg(long, default_value_t = Method::default())]
    pub(super) method: Method,
    /// Weight of sparsity, relative to a flood photograph of mean 1; chosen by
    /// held-out photographs if left out
    #[arg(long, value_name = "WEIGHT")]
    pub(super) lambda: Option<f64>,
    /// Light of reference white in camera units; by default the brightest uniform
    /// grey that every live cell reaches
    #[arg(long, value_name = "LIGHT")]
    pub(super) white: Option<f64>,
}

#[derive(Debug, Args)]
pub(super) struct Inspect {
    /// Table to read
    pub(super) table: PathBuf,
}
#[derive(Debug, Args)]
pub(super) struct Compensate {
    /// Table to compensate with
    pub(super) table: PathBuf,
    /// PNG or Y4M, of the grid's size or larger; `-` reads a Y4M from standard input
    pub(super) input: PathBuf,
    /// Where to write, in the input's format; `-` is standard output
    #[arg(short, long, value_name = "OUTPUT")]
    pub(super) output: PathBuf,
    /// Samples are in proportion to light, in and out; otherwise sRGB in and the
    /// projector's response out
    #[arg(long)]
    pub(super) linear: bool,
    /// Tier of the table's accuracy ladder; the most accurate if left out
    #[arg(long, value_name = "TIER")]
    pub(super) tier: Option<u8>,
}
