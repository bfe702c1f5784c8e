//! What can be typed.

use super::failure::Kind;
#[cfg(unix)]
use crate::device::emulator::Board;
use crate::device::port::BAUD;
use crate::solve::Method;
use clap::{Args, Parser, Subcommand};
#[cfg(unix)]
use iltm_runtime::FrameSize;
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
    /// Say how a device is
    Status(Status),
    /// Watch a device: frame rate, tier, time budget, events, log
    Monitor(Monitor),
    /// Run the firmware on an emulated board, with its serial line as a port
    #[cfg(unix)]
    Emulate(Emulate),
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

#[derive(Debug, Args)]
pub(super) struct SerialLine {
    /// Serial port of the device
    #[arg(long, value_name = "PORT")]
    pub(super) port: String,
    /// Speed of the line, bits a second
    #[arg(long, value_name = "BAUD", default_value_t = BAUD)]
    pub(super) baud: u32,
}

#[derive(Debug, Args)]
pub(super) struct Status {
    #[command(flatten)]
    pub(super) line: SerialLine,
}

#[derive(Debug, Args)]
pub(super) struct Monitor {
    #[command(flatten)]
    pub(super) line: SerialLine,
    /// ELF file of the device's firmware, which has the words of its log messages
    #[arg(long, value_name = "ELF")]
    pub(super) firmware: Option<PathBuf>,
    /// Milliseconds between two reports of the device
    #[arg(long, value_name = "MS", default_value_t = 500)]
    pub(super) period: u16,
}

#[cfg(unix)]
#[derive(Debug, Args)]
pub(super) struct Emulate {
    /// Table in the board's flash; without one it shows frames as they are
    pub(super) table: Option<PathBuf>,
    /// Board: mps2-an500 (Cortex-M7) or mps2-an386 (Cortex-M4F)
    #[arg(long, value_name = "BOARD", default_value_t)]
    pub(super) board: Board,
    /// ELF file of the firmware; by default that of the source folder, built anew
    #[arg(long, value_name = "ELF")]
    pub(super) firmware: Option<PathBuf>,
    /// PNG or Y4M to play over and over, instead of a moving test scene
    #[arg(long, value_name = "INPUT")]
    pub(super) frames: Option<PathBuf>,
    /// Size of the test scene; by default 128x96, or the grid's where that is larger
    #[arg(long, value_name = "WxH", value_parser = frame_size, conflicts_with = "frames")]
    pub(super) size: Option<FrameSize>,
    /// Frames a second; by default the video's own rate, or 25
    #[arg(long, value_name = "RATE", value_parser = rate)]
    pub(super) fps: Option<f64>,
    /// File that holds the board's memory and keeps it for the next time
    #[arg(long, value_name = "FILE")]
    pub(super) memory: Option<PathBuf>,
}

#[cfg(unix)]
fn frame_size(text: &str) -> Result<FrameSize, String> {
    let sides = text.split_once('x');
    let side = |text: &str| text.parse::<u16>().ok();
    sides
        .and_then(|(width, height)| FrameSize::new(side(width)?, side(height)?))
        .ok_or_else(|| "a size is written like 320x240".to_owned())
}

#[cfg(unix)]
fn rate(text: &str) -> Result<f64, String> {
    let rate = text.parse::<f64>().ok();
    rate.filter(|rate| (0.1..=1_000.0).contains(rate))
        .ok_or_else(|| "a rate is a number from 0.1 to 1000".to_owned())
}
