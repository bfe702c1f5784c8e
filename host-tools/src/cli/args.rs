//! Arguments of the command line.

use super::failure::Kind;
use super::name_parser::NameParser;
use super::simulate_chain::Chain;
use crate::capture::{CameraSettings, GateName, MapFormat};
use crate::compile::NEIGHBOURS_FACTOR;
#[cfg(unix)]
use crate::device::emulator::Board;
use crate::scene::{CaptureFault, Effect, InjectedFault};
use crate::solve::Method;
use crate::video::Fit;
use clap::{ArgGroup, Args, Parser, Subcommand};
use iltm_runtime::FrameSize;
use std::ffi::OsString;
use std::ops::{Bound, RangeBounds, RangeInclusive};
use std::path::{Component, Path, PathBuf};
use std::time::Duration;
use strum::{VariantArray, VariantNames};

/// Cancels the light that bounces between the surfaces of a projection.
#[derive(Debug, Parser)]
#[command(name = "iltm", version, about, after_help = Kind::table())]
pub(super) struct Arguments {
    /// Print the result as a JSON object, or what happens as an object a line
    #[arg(long, global = true)]
    pub(super) json: bool,
    #[command(subcommand)]
    pub(super) command: Command,
}

fn effect() -> NameParser<Effect> {
    NameParser::new(Effect::VARIANTS.iter().copied())
}

fn fault() -> NameParser<InjectedFault> {
    NameParser::new(CaptureFault::VARIANTS.iter().copied())
}

fn gate() -> NameParser<GateName> {
    NameParser::new(GateName::ALL.iter().map(|gate| gate.name()))
}

fn method() -> NameParser<Method> {
    NameParser::new(Method::VARIANTS.iter().map(Into::into))
}

#[cfg(unix)]
fn board() -> NameParser<Board> {
    NameParser::new(Board::VARIANTS.iter().map(|board| board.name()))
}

#[derive(Debug, Subcommand)]
pub(super) enum Command {
    /// Do the whole job without hardware: photographs, table, compensated video, report
    Demo(Demo),
    /// Take photographs of a described scene, with the effects that it calls for
    Simulate(Simulate),
    /// Look whether photographs can be used: every gate with its number and next step
    Check(Check),
    /// Make a folder of pictures to show and photograph, with the rules for doing so
    Patterns(Patterns),
    /// Show a folder's slides and photograph each, with a camera on a cable or a person
    #[command(after_help = CAMERAS)]
    Capture(Capture),
    /// Put photographs from several places of the camera together as one capture
    Join(Join),
    /// Learn a scene from its photographs and write its table
    Solve(Solve),
    /// Say what is in a table
    Inspect(Inspect),
    /// Compensate a picture or a video with a table
    Compensate(Compensate),
    /// Play films on the projector, compensated, with mpv
    Play(Play),
    /// Write a table as files for the players that people use
    Export(Export),
    /// Separate a photograph's light into direct light, second, third, ... bounce
    Bounces(Bounces),
    /// Every way to photograph and to invert on the same light, or the paper's figures
    Compare(Compare),
    /// Show what accuracy costs in time, for a scene or a table
    Tradeoff(Tradeoff),
    /// Prove a table on the wall: test images to photograph, then a verdict
    Verify(Verify),
    /// Feed photographs of compensated images back into a table
    Refine(Refine),
    /// Make a table for the device of each projector from that of several
    Split(Split),
    /// Sign a table, so that devices with the key take it
    Sign(Sign),
    /// List the serial ports and the devices that answer there
    Ports(Ports),
    /// Bring a table to a device, which uses it on trial
    Flash(Flash),
    /// Keep the table that is on trial
    Confirm(Decide),
    /// Go back to the table before
    Rollback(Decide),
    /// Say how a device is
    Status(Status),
    /// Watch a device: frame rate, tier, time budget, events, log
    Monitor(Monitor),
    /// Make, show and install keys that tables are signed with
    Key(Key),
    /// Write a zip file for support: versions, status, logs, transcripts; never keys
    #[command(alias = "report")]
    SupportBundle(SupportBundle),
    /// Write manual pages
    Man(Man),
    /// Print completions for a shell
    Completions(Completions),
    /// Run the firmware on an emulated board, with its serial line as a port
    #[cfg(unix)]
    Emulate(Emulate),
}

/// Whether a command says all that it knows of a table.
#[derive(Clone, Copy, Debug, Args)]
pub(super) struct Detail {
    /// Say everything: photographs, devices, theory, tiers, where the table comes from
    #[arg(long, short)]
    pub(super) verbose: bool,
}

#[derive(Debug, Args)]
pub(super) struct Demo {
    #[command(flatten)]
    pub(super) detail: Detail,
    /// Folder to write into; made if it is not there
    #[arg(long, value_name = "DIR", default_value = "iltm-demo")]
    pub(super) out: PathBuf,
}

#[derive(Debug, Args)]
pub(super) struct Simulate {
    /// Scene to simulate
    #[arg(value_name = "SCENE.toml")]
    pub(super) scene: PathBuf,
    /// Capture folder to make; with --shot, the photograph to write
    #[arg(
        short,
        long,
        value_name = "CAPTURE",
        required_unless_present_any = ["explain", "ablate", "photograph"]
    )]
    pub(super) output: Option<PathBuf>,
    /// Take the photographs that this folder calls for and does not have: one that
    /// `iltm patterns` or `iltm verify` made, or one with the captures of all projectors, named as
    /// they are
    #[arg(long, value_name = "FOLDER")]
    pub(super) photograph: Option<PathBuf>,
    /// The folder's slides are those of this one of the scene's projectors, named or counted
    /// from 1; all others show black
    #[arg(long, value_name = "NAME", requires = "photograph")]
    pub(super) projector: Option<String>,
    /// Photograph from this one of the scene's further places of the camera, named or counted
    /// from 1, with the exposure of [camera]
    #[arg(long, value_name = "NAME")]
    pub(super) pose: Option<String>,
    /// Take only the photograph with this index, and write it to --output
    #[arg(
        long,
        value_name = "INDEX",
        requires = "photograph",
        requires = "output"
    )]
    pub(super) shot: Option<u32>,
    /// Show the folder's slides through a chain that compensates with --table, to practise
    /// `iltm verify --wanted`: once as it should be, or off, twice, mirrored, shifted=PIXELS,
    /// scaled=FACTOR
    #[arg(
        long,
        value_name = "CHAIN",
        requires = "photograph",
        requires = "table",
        conflicts_with = "shot"
    )]
    pub(super) chain: Option<Chain>,
    /// Table of the chain
    #[arg(long, value_name = "TABLE.iltm", requires = "chain")]
    pub(super) table: Option<PathBuf>,
    /// Let something go wrong, to practise: gamma, auto-exposure, tripod, swapped,
    /// dropped, skipped, clipped, vivid or flicker, with `=SIZE` if it is to be smaller or
    /// larger than usual; may be repeated
    #[arg(long, value_name = "FAULT", value_parser = fault(), hide_possible_values = true)]
    pub(super) fault: Vec<InjectedFault>,
    /// Say which effects are simulated and why
    #[arg(long)]
    pub(super) explain: bool,
    /// Turn every effect the other way, one at a time, and say what that changes
    #[arg(long)]
    pub(super) ablate: bool,
    /// Bernoulli photographs, beside white, black and the Gray code
    #[arg(
        long,
        value_name = "M",
        default_value_t = 150,
        conflicts_with = "photograph",
        requires = "output"
    )]
    pub(super) photos: usize,
    /// Seed of the patterns and of the noise
    #[arg(long, value_name = "S", default_value_t = 1)]
    pub(super) seed: u64,
    /// Simulate an effect whatever the scene says; may be repeated
    #[arg(long, value_name = "EFFECT", value_parser = effect(), hide_possible_values = true)]
    pub(super) with: Vec<Effect>,
    /// Leave an effect out whatever the scene says; may be repeated
    #[arg(long, value_name = "EFFECT", value_parser = effect(), hide_possible_values = true)]
    pub(super) without: Vec<Effect>,
    /// Share of white below which an effect is left out; by default what the
    /// camera's noise hides
    #[arg(long, value_name = "SHARE", value_parser = share)]
    pub(super) threshold: Option<f64>,
}

#[derive(Debug, Args)]
pub(super) struct Check {
    /// Folder with `capture.csv`, patterns and photographs; of several projectors, one for each, from
    /// left to right, which are compared with each other too
    #[arg(value_name = "CAPTURE", required = true)]
    pub(super) captures: Vec<PathBuf>,
    /// Folder to make, with a page that shows what each gate saw; of one capture
    #[arg(short, long, value_name = "DIR")]
    pub(super) output: Option<PathBuf>,
    /// Look only at the first M Bernoulli photographs beside all others
    #[arg(long, value_name = "M")]
    pub(super) photos: Option<usize>,
    /// File to write, .npy or .exr, with the place of the projector's picture that every camera
    /// pixel sees; of one capture
    #[arg(long, value_name = "FILE", value_parser = map_file)]
    pub(super) map: Option<(PathBuf, MapFormat)>,
}

#[derive(Debug, Args)]
#[command(group(ArgGroup::new("cells").required(true)))]
pub(super) struct Patterns {
    /// Capture folder to make
    #[arg(short, long, value_name = "CAPTURE")]
    pub(super) output: PathBuf,
    /// Rows of cells
    #[arg(long, value_name = "R", requires = "cols", group = "cells")]
    pub(super) rows: Option<u16>,
    /// Columns of cells
    #[arg(long, value_name = "C", requires = "rows")]
    pub(super) cols: Option<u16>,
    /// In place of rows and columns: the size of the camera's photographs. Cells are then as
    /// small as is of use, about 7 of its pixels a side, and no more than 3072
    #[arg(long, value_name = "WxH", value_parser = frame_size, group = "cells")]
    pub(super) camera_size: Option<FrameSize>,
    /// Bernoulli patterns, beside white, black and the Gray code; together with images at least 10
    #[arg(long, value_name = "M", default_value_t = 150, value_parser = clap::value_parser!(u16).range(..=10_000))]
    pub(super) photos: u16,
    /// Show this folder's pictures too, cut to the projector's aspect: they teach as Bernoulli
    /// patterns do, beside them or with `--photos 0` instead
    #[arg(long, value_name = "DIR")]
    pub(super) images: Option<PathBuf>,
    /// Seed of the Bernoulli patterns
    #[arg(long, value_name = "S", default_value_t = 1)]
    pub(super) seed: u64,
    /// The projector's own resolution. Of several projectors one each, with a name that its folder in
    /// CAPTURE gets: --projector left=1920x1080 --projector right=1280x800. Rows and columns are the
    /// first one's; cells of the others have as many pixels
    #[arg(long, value_name = "[NAME=]WxH", value_parser = named_size, default_value = "1920x1080")]
    pub(super) projector: Vec<NamedSize>,
    /// Pixels to leave black on every side
    #[arg(long, value_name = "PIXELS", default_value_t = 0)]
    pub(super) border: u16,
    /// How the camera's files follow the light: linear (developed without a curve),
    /// srgb (JPEG and most 8-bit files), a gamma, or measure
    #[arg(long, value_name = "RESPONSE", default_value = "linear", value_parser = camera_response)]
    pub(super) camera: CameraSettings,
    /// Levels of the response ramp, shown in white and in each channel
    #[arg(long, value_name = "LEVELS", default_value_t = 9, value_parser = clap::value_parser!(u16).range(2..=256))]
    pub(super) ramp: u16,
    /// Leave out the pictures that measure projector and camera: ramp and blur probe
    #[arg(long, conflicts_with = "ramp")]
    pub(super) no_calibration: bool,
    /// Leave out the stripes finer than the cells, by which every camera pixel finds its place in
    /// the projector's picture
    #[arg(long)]
    pub(super) no_dense: bool,
    /// Show white and black again after this many other pictures
    #[arg(long, value_name = "K", default_value_t = 16, value_parser = clap::value_parser!(u16).range(1..))]
    pub(super) repeat_every: u16,
}

/// What `iltm capture --help` ends with.
const CAMERAS: &str = "\
Commands are run by the shell. Each of these words stands for one word of the
shell, spaces and all, with and without double quotes around it:
  {photo}     file to write      {stem}   the same without its ending
  {slide}     file that is shown {index}  its number
  {role}      what it is shown for
  {exposure}  the fifth column of capture.csv, if there is one
A second shell (sh -c, eval, ssh) may read a name with other characters than
letters, digits and /._-+:=@ as part of its command: put that command in a
script, which gets the name as its argument.

Cameras, each with exposure, white balance and focus set by hand before:
  --camera 'gphoto2 --force-overwrite --capture-image-and-download \\
            --filename {stem}.jpg'
  --camera 'libcamera-still -n --immediate -e png --shutter 33333 --gain 1 \\
            --awbgains 2,2 -o {photo}'
  --camera 'v4l2-ctl -v pixelformat=MJPG --stream-mmap --stream-count=1 \\
            --stream-to={stem}.jpg'
  --watch ~/Pictures/tethered      whatever fills that folder

Slides without a desktop: --show 'cp {slide} /media/player/now.png'; the command
returns when the slide is shown. Escape on the slide, or ctrl-C, ends a session;
the same command goes on with what is missing.";

#[derive(Debug, Args)]
#[allow(clippy::struct_field_names, reason = "it is what stands there")]
pub(super) struct Capture {
    /// Folder that `iltm patterns` or `iltm verify` made; of several projectors one each, which
    /// are photographed one after the other
    #[arg(required = true, value_name = "CAPTURE")]
    pub(super) captures: Vec<PathBuf>,
    /// Display to show slides on, the first is 0; of one that is not there, all are listed. Of
    /// several folders one display each, black while another shows; of one folder with wide
    /// slides all that show them, from left to right: 1,2
    #[arg(long, value_name = "N", value_delimiter = ',', group = "screen", required_unless_present_any = ["show", "list"])]
    pub(super) display: Vec<u16>,
    /// Keep other displays black meanwhile: 3, or 0,3
    #[arg(long, value_name = "N", value_delimiter = ',', requires = "display")]
    pub(super) dark: Vec<u16>,
    /// Show slides by a command instead, which returns when the slide is shown
    #[arg(long, value_name = "CMD", group = "screen")]
    pub(super) show: Option<String>,
    /// Command that takes one photograph and writes it to {photo}
    #[arg(long, value_name = "CMD", group = "taker", required_unless_present_any = ["watch", "list"])]
    pub(super) camera: Option<String>,
    /// Take the photographs that appear in a folder instead, one a slide
    #[arg(long, value_name = "FOLDER", group = "taker")]
    pub(super) watch: Option<PathBuf>,
    /// Wait this long after each change of the picture; measured with flashes of white
    /// and black if left out (with --watch: no wait)
    #[arg(long, value_name = "MS")]
    pub(super) latency: Option<u32>,
    /// Wait this long for one photograph
    #[arg(long, value_name = "SECONDS", default_value_t = 60, value_parser = clap::value_parser!(u32).range(1..))]
    pub(super) timeout: u32,
    /// Try a photograph that fails so many times more
    #[arg(long, value_name = "N", default_value_t = 2)]
    pub(super) retries: u32,
    /// Take these again although they are there: 7, or 7-12
    #[arg(long, value_name = "INDEX", num_args = 1.., value_delimiter = ',', value_parser = indices)]
    pub(super) again: Vec<RangeInclusive<u32>>,
    /// Say what is missing, and take nothing
    #[arg(long, conflicts_with_all = ["screen", "dark", "taker", "again", "latency", "timeout", "retries"])]
    pub(super) list: bool,
}

#[derive(Debug, Args)]
pub(super) struct Solve {
    #[command(flatten)]
    pub(super) detail: Detail,
    /// Folder with `capture.csv`, patterns and photographs; of several projectors one each,
    /// photographed while the others were dark, from left to right in the wide frame
    #[arg(required = true, value_name = "CAPTURE")]
    pub(super) captures: Vec<PathBuf>,
    /// Table to write
    #[arg(short, long, value_name = "TABLE.iltm")]
    pub(super) output: PathBuf,
    /// Use only the first M Bernoulli photographs beside all others
    #[arg(long, value_name = "M")]
    pub(super) photos: Option<usize>,
    /// Go on although this gate fails (see `iltm check`); may be repeated
    #[arg(long, value_name = "GATE", value_parser = gate(), hide_possible_values = true)]
    pub(super) ignore: Vec<GateName>,
    /// How to find the inverse: `joint` (all channels and photographs, with what
    /// physics knows), `links` (the same from blocks of cells, in less time for many),
    /// `direct` (the paper's plain l1), `two-stage` (plain l1 for the transport, then
    /// its inverse) or `brute-force` (least squares for the transport); by default
    /// `joint`, or `links` from 2048 cells and 200 photographs on and above 6144 cells
    #[arg(long, value_parser = method(), hide_possible_values = true)]
    pub(super) method: Option<Method>,
    /// Weight of sparsity, relative to a flood photograph of mean 1; chosen by
    /// held-out photographs if left out
    #[arg(long, value_name = "WEIGHT")]
    pub(super) lambda: Option<f64>,
    /// Light of reference white in camera units; by default the brightest uniform
    /// grey that every live cell reaches
    #[arg(long, value_name = "LIGHT", conflicts_with = "content")]
    pub(super) white: Option<f64>,
    /// Most samples of the gains, which are finer than the cells: more of them correct finer
    /// texture and make the table larger; by default as fine as the camera tells, at most
    /// one a pixel of the projector
    #[arg(long, value_name = "WxH", value_parser = frame_size)]
    pub(super) gain_resolution: Option<FrameSize>,
    /// Leave light that is there without the projector as it is, for a room that is darker
    /// in the show than in the photographs; by default it counts as a part of the picture
    #[arg(long)]
    pub(super) keep_ambient: bool,
    /// Raise black to that of the brightest part, so that it is even: where projectors overlap,
    /// their black adds up, which dark pictures show
    #[arg(long, conflicts_with = "keep_ambient")]
    pub(super) match_black: bool,
    /// Picture or video (PNG, Y4M) that is going to be shown: reference white is the
    /// brightest that cuts no more of it than --clip-share; may be repeated
    #[arg(long, value_name = "FILE")]
    pub(super) content: Vec<PathBuf>,
    /// What becomes of content whose aspect is not the projector's, which is refused
    /// otherwise: letterbox, crop or stretch, as for `iltm compensate`
    #[arg(long, value_name = "HOW", requires = "content")]
    pub(super) fit: Option<Fit>,
    /// Share of the content's samples that may be cut at the projector's white
    #[arg(long, value_name = "SHARE", value_parser = share, default_value_t = 0.001, requires = "content")]
    pub(super) clip_share: f64,
    /// Folder for a report of the scene: a page with pictures; made if it is not there
    #[arg(long, value_name = "DIR")]
    pub(super) report: Option<PathBuf>,
    /// Name of the table, which devices show; by default that of the scene, or of the
    /// capture's folder
    #[arg(long, value_name = "NAME")]
    pub(super) name: Option<String>,
    /// Sign the table with this key
    #[arg(long, value_name = "FILE")]
    pub(super) key: Option<PathBuf>,
    #[command(flatten)]
    pub(super) seal: SealTerms,
}

#[derive(Debug, Args)]
pub(super) struct Bounces {
    /// Folder with `capture.csv`, patterns and photographs
    pub(super) capture: PathBuf,
    /// Folder to make
    #[arg(short, long, value_name = "DIR")]
    pub(super) output: PathBuf,
    /// `index` of the photograph in `capture.csv`; the mean of all of white if left out
    #[arg(long, value_name = "INDEX")]
    pub(super) photo: Option<u32>,
    /// Learn the inverse from only the first M Bernoulli photographs beside all others
    #[arg(long, value_name = "M")]
    pub(super) photos: Option<usize>,
}

#[derive(Debug, Args)]
pub(super) struct SealTerms {
    /// Version of the signed table; devices with the key take none below the highest that
    /// was confirmed there; minutes since 1970 if left out
    #[arg(long, value_name = "N", requires = "key", value_parser = clap::value_parser!(u32).range(1..))]
    pub(super) table_version: Option<u32>,
    /// Number of the only device that the signed table is for; any if left out
    #[arg(long, value_name = "NUMBER", requires = "key", value_parser = device_number)]
    pub(super) for_device: Option<u64>,
    /// Once the table is confirmed, versions below this never run again on the device
    #[arg(long, value_name = "N", requires = "key")]
    pub(super) revoke_below: Option<u32>,
}

#[derive(Debug, Args)]
pub(super) struct Compare {
    /// Capture folder or SCENE.toml whose light is compared on
    #[arg(
        value_name = "CAPTURE|SCENE.toml",
        required_unless_present = "paper",
        conflicts_with = "paper"
    )]
    pub(super) light: Option<PathBuf>,
    /// Repeat the experiments of Chu, Ng, Pahwa, Quek, Huang (BMVC 2011), with intervals
    #[arg(long)]
    pub(super) paper: bool,
    /// Folder to write into; made if it is not there
    #[arg(short, long, value_name = "DIR")]
    pub(super) output: PathBuf,
    /// Photographs for the methods that take as many as one likes
    #[arg(long, value_name = "M", default_value_t = 150)]
    pub(super) photos: usize,
    /// Seed of patterns and noise
    #[arg(long, value_name = "S", default_value_t = 1)]
    pub(super) seed: u64,
}

#[derive(Debug, Args)]
pub(super) struct Sign {
    /// Table to sign
    pub(super) table: PathBuf,
    /// Private key
    #[arg(long, value_name = "FILE")]
    pub(super) key: PathBuf,
    #[command(flatten)]
    pub(super) seal: SealTerms,
    /// Where to write; by default the table itself
    #[arg(short, long, value_name = "TABLE.iltm")]
    pub(super) output: Option<PathBuf>,
}

#[derive(Debug, Args)]
pub(super) struct Ports {
    /// Speed to try first; lower ones follow
    #[arg(long, value_name = "BAUD")]
    pub(super) baud: Option<u32>,
}

#[derive(Debug, Args)]
pub(super) struct Flash {
    /// Table to bring
    pub(super) table: PathBuf,
    #[command(flatten)]
    pub(super) line: SerialLine,
    /// Seconds until the device goes back by itself, unless somebody confirms
    #[arg(long, value_name = "SECONDS", default_value_t = 300, value_parser = clap::value_parser!(u16).range(1..))]
    pub(super) trial: u16,
    /// Confirm at once, without looking at the wall first
    #[arg(long)]
    pub(super) confirm: bool,
    /// Say what would be sent and change nothing
    #[arg(long)]
    pub(super) dry_run: bool,
    /// Site's or technician's key that shows a device with a key the right to do so
    #[arg(long, value_name = "FILE")]
    pub(super) key: Option<PathBuf>,
}

#[derive(Debug, Args)]
pub(super) struct Decide {
    #[command(flatten)]
    pub(super) line: SerialLine,
    /// Site's or technician's key that shows a device with a key the right to do so
    #[arg(long, value_name = "FILE")]
    pub(super) key: Option<PathBuf>,
}

#[derive(Debug, Args)]
pub(super) struct Key {
    #[command(subcommand)]
    pub(super) command: KeyCommand,
}

#[derive(Debug, Subcommand)]
pub(super) enum KeyCommand {
    /// Make a new private key
    New {
        /// File to write; never one that is there already
        #[arg(short, long, value_name = "FILE", default_value = "iltm.key")]
        output: PathBuf,
    },
    /// Say a key's public key and id
    Show {
        /// Private or public key
        file: PathBuf,
    },
    /// Give a device that has none its public key, for good
    Install(Install),
    /// Make a technician's key: it flashes tables that the site signed, and signs none
    Technician(Technician),
}

#[derive(Debug, Args)]
pub(super) struct Technician {
    /// The site's private key
    pub(super) site: PathBuf,
    /// File to write; never one that is there already
    #[arg(short, long, value_name = "FILE")]
    pub(super) output: PathBuf,
    /// Number of the only device that it is for; any if left out
    #[arg(long, value_name = "NUMBER", value_parser = device_number, default_value = "0", hide_default_value = true)]
    pub(super) device: u64,
    /// Void on devices that confirmed a table with a higher --revoke-below; minutes since
    /// 1970 if left out
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    pub(super) version: Option<u32>,
}

#[derive(Debug, Args)]
pub(super) struct Install {
    /// Private or public key; only the public one is sent
    pub(super) file: PathBuf,
    /// Number that the device gets, so that tables can be made for it alone
    #[arg(long, value_name = "NUMBER", value_parser = device_number, default_value = "0", hide_default_value = true)]
    pub(super) device: u64,
    #[command(flatten)]
    pub(super) line: SerialLine,
    /// Do not ask whether this is meant
    #[arg(long)]
    pub(super) yes: bool,
    /// Also where the table in use would be refused from the device's next start on
    #[arg(long)]
    pub(super) lose_table: bool,
}

#[derive(Debug, Args)]
pub(super) struct SupportBundle {
    /// Zip file to write
    #[arg(short, long, value_name = "FILE.zip")]
    pub(super) output: PathBuf,
    #[command(flatten)]
    pub(super) line: SerialLine,
    /// ELF file of the device's firmware, which has the words of its log messages
    #[arg(long, value_name = "ELF")]
    pub(super) firmware: Option<PathBuf>,
    /// Seconds for which logs are gathered
    #[arg(long, value_name = "SECONDS", default_value_t = 3)]
    pub(super) seconds: u16,
}

#[derive(Debug, Args)]
pub(super) struct Man {
    /// Folder to write into; made if it is not there
    #[arg(short, long, value_name = "DIR")]
    pub(super) output: PathBuf,
}

#[derive(Debug, Args)]
pub(super) struct Completions {
    /// Shell to complete for
    pub(super) shell: clap_complete::Shell,
}

#[derive(Debug, Args)]
pub(super) struct Inspect {
    #[command(flatten)]
    pub(super) detail: Detail,
    /// Table to read
    pub(super) table: PathBuf,
    /// Key to verify its signature with
    #[arg(long, value_name = "FILE")]
    pub(super) key: Option<PathBuf>,
}

#[derive(Debug, Args)]
pub(super) struct Tradeoff {
    /// Folder with `capture.csv`, patterns and photographs, or a table
    #[arg(value_name = "CAPTURE|TABLE.iltm")]
    pub(super) input: PathBuf,
    /// Folder to write into; made if it is not there
    #[arg(short, long, value_name = "DIR")]
    pub(super) output: PathBuf,
}

#[derive(Debug, Args)]
pub(super) struct Compensate {
    /// Table to compensate with
    pub(super) table: PathBuf,
    /// PNG or Y4M in the projector's aspect, of the size inside its border, or of one pixel
    /// a cell; `-` reads from standard input
    pub(super) input: PathBuf,
    /// Where to write, in the input's format; `-` is standard output
    #[arg(short, long, value_name = "OUTPUT")]
    pub(super) output: PathBuf,
    /// Samples are in proportion to light, in and out; otherwise sRGB in and the
    /// projector's response out
    #[arg(long)]
    pub(super) linear: bool,
    /// What becomes of frames whose aspect is not the projector's, which are refused
    /// otherwise: letterbox (black bars), crop (edges cut off) or stretch (shown stretched)
    #[arg(long, value_name = "HOW")]
    pub(super) fit: Option<Fit>,
    /// Tier of the table's accuracy ladder; the most accurate if left out
    #[arg(long, value_name = "TIER", conflicts_with = "budget")]
    pub(super) tier: Option<u8>,
    /// Look at the table's file while the video runs, and go on with a new table between
    /// two frames; one that cannot be used changes nothing
    #[arg(long)]
    pub(super) watch: bool,
    /// Milliseconds that computing a frame may take: lower tiers when it takes longer,
    /// higher ones when there is time, as on the device
    #[arg(long, value_name = "MS", value_parser = milliseconds)]
    pub(super) budget: Option<Duration>,
    /// Frames larger than one pixel a cell are worked on by the graphics processor, with the same
    /// result; for a program that was built with the feature `gpu`
    #[arg(long)]
    pub(super) gpu: bool,
}

const PLAY_KEYS: &str = "\
Keys:
  c          with compensation or without
  + -        tier of the table's accuracy ladder
  w          white everywhere
  t          test card, as it is
  i          status line
  space      pause
  n p        next and previous film
  q, escape  end";

#[derive(Debug, Args)]
#[command(after_help = PLAY_KEYS)]
pub(super) struct Play {
    /// Table to compensate with; a new one in its place is used at once
    pub(super) table: PathBuf,
    /// Films, pictures, playlists or whatever else mpv plays, in turn and over again; `-` reads
    /// from standard input
    #[arg(required = true, value_name = "FILM")]
    pub(super) films: Vec<OsString>,
    /// Display to fill, the first is 0, as in `iltm capture`; it must have as many pixels as the
    /// table's projector. Of a wide frame all displays that show it, from left to right: 1,2
    #[arg(long, value_name = "N", value_delimiter = ',')]
    pub(super) display: Vec<u16>,
    /// Tier of the table's accuracy ladder; the most accurate if left out
    #[arg(long, value_name = "TIER")]
    pub(super) tier: Option<u8>,
    /// End after the last film
    #[arg(long)]
    pub(super) once: bool,
    /// End where something goes wrong: a film that cannot be played, no sound, another display
    #[arg(long)]
    pub(super) strict: bool,
    /// Options for mpv
    #[arg(last = true, value_name = "MPV")]
    pub(super) mpv: Vec<OsString>,
}

#[allow(
    clippy::doc_markdown,
    reason = "help has no marks around names of programs"
)]
#[derive(Debug, Args)]
pub(super) struct Export {
    /// Table to export
    pub(super) table: PathBuf,
    /// What for: mpv (a user shader, also for ffmpeg's `libplacebo` filter), isf (a shader for
    /// MadMapper, VDMX, ossia score and others), glsl (shaders for TouchDesigner), or maps (pictures for
    /// servers that know alpha and beta maps alone)
    #[arg(long = "as", value_name = "PLAYER")]
    pub(super) player: Player,
    /// Folder to make
    #[arg(short, long, value_name = "DIR")]
    pub(super) output: PathBuf,
    /// Tier of the table's accuracy ladder; the most accurate if left out
    #[arg(long, value_name = "TIER")]
    pub(super) tier: Option<u8>,
}

/// Whom a table is exported for.
#[allow(
    clippy::doc_markdown,
    reason = "help has no marks around names of programs"
)]
#[derive(Clone, Copy, PartialEq, Eq, Debug, clap::ValueEnum)]
pub(super) enum Player {
    /// A user shader for mpv and libplacebo
    Mpv,
    /// An ISF shader and its pictures
    Isf,
    /// GLSL shaders and pictures for TouchDesigner
    Glsl,
    /// Pictures for servers that know maps alone
    Maps,
}

#[derive(Debug, Args)]
pub(super) struct Verify {
    /// Table to verify
    pub(super) table: PathBuf,
    /// Folder made with --output, with the photographs in it: judge them
    #[arg(
        value_name = "FOLDER",
        required_unless_present = "output",
        conflicts_with = "output"
    )]
    pub(super) capture: Option<PathBuf>,
    /// Folder to make, with the pictures to project
    #[arg(short, long, value_name = "FOLDER")]
    pub(super) output: Option<PathBuf>,
    /// Write the test images as they should look, for the player or the device that will
    /// compensate them: the verdict is then on the chain that really runs
    #[arg(long, requires = "output")]
    pub(super) wanted: bool,
    /// Captures that the table was solved from, from left to right, where projectors overlap: they say
    /// which places two of them light
    #[arg(long, value_name = "CAPTURE", num_args = 1.., requires = "output")]
    pub(super) captures: Vec<PathBuf>,
    /// Resolution of the projector; by default as the patterns of the scene had it, which
    /// the table remembers, or 1920x1080
    #[arg(long, value_name = "WxH", value_parser = frame_size, requires = "output")]
    pub(super) projector: Option<FrameSize>,
    /// Black pixels on each side; by default as the patterns of the scene had it, or none
    #[arg(long, value_name = "PIXELS", requires = "output")]
    pub(super) border: Option<u16>,
    /// Leave out the stripes and images of the projector's own pixels, by which the error is seen
    /// pixel by pixel and the table can be refined
    #[arg(long, requires = "output", conflicts_with = "wanted")]
    pub(super) no_dense: bool,
    /// Photographs of the film of a --wanted folder, with any names and as many as there are,
    /// in the order of the numbers in them: what each shows is known by the card before it
    #[arg(long, value_name = "DIR", conflicts_with = "output")]
    pub(super) photographs: Option<PathBuf>,
    /// Largest error that passes, of cells and of what all images share at pixels; by default 1.5
    /// times what is to be expected of either
    #[arg(long, value_name = "ERROR", value_parser = error_bound, conflicts_with = "output")]
    pub(super) bound: Option<f64>,
    /// Folder for the page and the maps; by default `verdict` in FOLDER
    #[arg(long, value_name = "DIR", conflicts_with = "output")]
    pub(super) report: Option<PathBuf>,
    /// Serial port of the device that is handed over: the page names its board, its firmware
    /// and the table that it uses
    #[arg(long, value_name = "PORT", conflicts_with = "output")]
    pub(super) port: Option<String>,
}

#[derive(Debug, Args)]
pub(super) struct Refine {
    /// Table to refine
    pub(super) table: PathBuf,
    /// Folder made for it by `iltm verify`, with the photographs in it
    #[arg(value_name = "FOLDER")]
    pub(super) capture: PathBuf,
    /// Where the better table goes; it is the same one if no step is confirmed by photographs
    /// that it was not made from
    #[arg(short, long, value_name = "FILE")]
    pub(super) output: PathBuf,
    /// Sign the table with this key
    #[arg(long, value_name = "FILE")]
    pub(super) key: Option<PathBuf>,
    #[command(flatten)]
    pub(super) seal: SealTerms,
}

#[derive(Debug, Args)]
pub(super) struct Join {
    /// Folder that was photographed from each place: a capture, or a folder with the captures of all
    /// projectors
    #[arg(required = true, num_args = 2.., value_name = "POSE")]
    pub(super) poses: Vec<PathBuf>,
    /// Folder for the joined capture, or for those of all projectors
    #[arg(short, long, value_name = "FOLDER")]
    pub(super) output: PathBuf,
    /// Go on although this gate fails; may be repeated
    #[arg(long, value_name = "GATE", value_parser = gate(), hide_possible_values = true)]
    pub(super) ignore: Vec<GateName>,
}

#[derive(Debug, Args)]
pub(super) struct Split {
    /// Table of several projectors, whose frames stand side by side
    pub(super) table: PathBuf,
    /// Folder for the tables, numbered from left to right
    #[arg(short, long, value_name = "FOLDER")]
    pub(super) output: PathBuf,
    /// How many projectors there are, their frames alike, where the table does not say
    #[arg(long, value_name = "COUNT")]
    pub(super) projectors: Option<usize>,
    /// Cells along each side of a frame that become one for its neighbours: more make less light to
    /// pass on and a coarser correction
    #[arg(long, value_name = "CELLS", default_value_t = NEIGHBOURS_FACTOR, value_parser = clap::value_parser!(u16).range(1..))]
    pub(super) neighbours: u16,
}

#[derive(Clone, Debug, Args)]
pub(super) struct SerialLine {
    /// Serial port of the device; by default the one that answers
    #[arg(long, value_name = "PORT")]
    pub(super) port: Option<String>,
    /// Speed of the line to try first, bits a second; lower ones follow
    #[arg(long, value_name = "BAUD")]
    pub(super) baud: Option<u32>,
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
    #[arg(long, value_name = "BOARD", default_value_t, value_parser = board(), hide_possible_values = true)]
    pub(super) board: Board,
    /// ELF file of the firmware; by default that of the source folder, built anew
    #[arg(long, value_name = "ELF")]
    pub(super) firmware: Option<PathBuf>,
    /// PNG or Y4M to play over and over, instead of a moving test scene
    #[arg(long, value_name = "INPUT")]
    pub(super) frames: Option<PathBuf>,
    /// Size of the test scene; by default 128x96 or the grid's where that is larger, in the
    /// aspect of the table's projector
    #[arg(long, value_name = "WxH", value_parser = frame_size, conflicts_with = "frames")]
    pub(super) size: Option<FrameSize>,
    /// Frames a second; by default the video's own rate, or 25
    #[arg(long, value_name = "RATE", value_parser = rate)]
    pub(super) fps: Option<f64>,
    /// Show what the board receives and what it sends to its projector in a window, by mpv
    #[arg(long)]
    pub(super) window: bool,
    /// Y4M file to make of the frames that it sends, as long as they have the size of the first
    #[arg(long, value_name = "VIDEO")]
    pub(super) save: Option<PathBuf>,
    /// File that holds the board's memory and keeps it for the next time
    #[arg(long, value_name = "FILE")]
    pub(super) memory: Option<PathBuf>,
    /// Key that the board gets in its factory: it takes only tables signed with it
    #[arg(long, value_name = "FILE")]
    pub(super) key: Option<PathBuf>,
    /// Number that the board gets with the key
    #[arg(long, value_name = "NUMBER", value_parser = device_number, default_value = "0", hide_default_value = true, requires = "key")]
    pub(super) device: u64,
}

/// A number, or the 16 hexadecimal digits that `iltm status` shows.
fn device_number(text: &str) -> Result<u64, String> {
    let number = match text.strip_prefix("0x") {
        Some(digits) => u64::from_str_radix(digits, 16),
        None => text.parse(),
    };
    number.map_err(|_| "a device's number is decimal, or hexadecimal with 0x before it".to_owned())
}

/// A response as `capture.toml` has it.
fn camera_response(text: &str) -> Result<CameraSettings, String> {
    let word = match text.parse::<f64>() {
        Ok(gamma) => toml::Value::Float(gamma),
        Err(_) => toml::Value::String(text.to_owned()),
    };
    let table = toml::Table::from_iter([("response".to_owned(), word)]);
    let settings = table.try_into::<CameraSettings>();
    settings.map_err(|error| error.message().to_owned())
}

/// A number, or two with all between them.
fn indices(text: &str) -> Result<RangeInclusive<u32>, String> {
    let (first, last) = text.split_once('-').unwrap_or((text, text));
    let range = first.parse().ok().zip(last.parse().ok());
    range
        .filter(|(first, last)| first <= last)
        .map(|(first, last)| first..=last)
        .ok_or_else(|| "numbers of slides are written like 7 or 7-12".to_owned())
}

/// A number in a range; `otherwise` says what is asked for.
fn number(text: &str, range: impl RangeBounds<f64>, otherwise: &str) -> Result<f64, String> {
    let number = text.parse().ok();
    let number = number.filter(|number| range.contains(number));
    number.ok_or_else(|| otherwise.to_owned())
}

fn share(text: &str) -> Result<f64, String> {
    number(text, 0.0..1.0, "a share is a number from 0 to 1")
}

fn milliseconds(text: &str) -> Result<Duration, String> {
    let otherwise = "a budget is a number of milliseconds from 0.001 to 60000";
    number(text, 0.001..=60_000.0, otherwise).map(|time| Duration::from_secs_f64(time / 1e3))
}

fn error_bound(text: &str) -> Result<f64, String> {
    let range = (Bound::Excluded(0.0), Bound::Included(1.0));
    number(text, range, "an error is a number above 0, at most 1")
}

/// A projector's pixels, and its name among several.
#[derive(Clone, Debug)]
pub(super) struct NamedSize {
    pub(super) name: Option<String>,
    pub(super) size: FrameSize,
}

fn named_size(text: &str) -> Result<NamedSize, String> {
    let (name, size) = match text.rsplit_once('=') {
        Some((name, size)) => (Some(name), size),
        None => (None, text),
    };
    let mut parts = name.map(|name| Path::new(name).components());
    let is_folder = parts.as_mut().is_none_or(|parts| {
        matches!(parts.next(), Some(Component::Normal(_))) && parts.next().is_none()
    });
    if !is_folder {
        return Err("the name is that of a folder, without slashes".to_owned());
    }
    Ok(NamedSize {
        name: name.map(str::to_owned),
        size: frame_size(size)?,
    })
}

fn frame_size(text: &str) -> Result<FrameSize, String> {
    let sides = text.split_once('x');
    let side = |text: &str| text.parse::<u16>().ok();
    sides
        .and_then(|(width, height)| FrameSize::new(side(width)?, side(height)?))
        .ok_or_else(|| "a size is written like 320x240".to_owned())
}

fn map_file(text: &str) -> Result<(PathBuf, MapFormat), String> {
    let path = PathBuf::from(text);
    let format = MapFormat::of(&path);
    let format = format.ok_or_else(|| "a map is a .npy or an .exr file".to_owned())?;
    Ok((path, format))
}

#[cfg(unix)]
fn rate(text: &str) -> Result<f64, String> {
    number(text, 0.1..=1_000.0, "a rate is a number from 0.1 to 1000")
}
