//! A verification folder with its photographs, read back and checked.

use super::folder::{TABLE_FILE, fine_file, grey, levels, plain, wanted_file};
use super::manifest::{VerifyManifest, VerifyRole, VerifyShot};
use super::response::ProjectorCurves;
use super::{Cause, Expected, VerifyError, refused, several, test_images};
use crate::Layout;
use iltm_capture::{
    CaptureError, CellPlanes, CellReadings, PictureShift, Remeasured, Settings, Shot, VERIFY_FILE,
    find_photo, projector_file, remeasure,
};
use iltm_compile::Provenance;
use iltm_picture::{
    LightPicture, Picture, Response, Samples, foreign_file, png, progress::Progress,
};
use iltm_runtime::{FrameSize, image::Table};
use iltm_video::{Compensator, VideoError};
use std::collections::BTreeMap;
use std::io::{BufReader, ErrorKind};
use std::path::{Path, PathBuf};

/// A test image that was photographed.
#[derive(Clone, Debug)]
pub struct Shown {
    /// Its number in `verify.csv`.
    pub image: u8,
    /// What it is, for people.
    pub title: String,
    /// Share of its samples that the table has to cut.
    pub clipped: f64,
    /// The light that was wanted, relative to reference white, one entry a channel.
    pub wanted: CellPlanes,
    /// Input of the projector for the picture as it is, and compensated, relative to its
    /// white.
    pub input: [CellPlanes; 2],
    /// What was photographed of either, camera units, ambient light included. Of a chain that
    /// compensates, the first is what the table expects.
    pub seen: [CellPlanes; 2],
    /// The photographs, relative to the folder.
    pub photos: [PathBuf; 2],
    /// The photographs for people, where there are some.
    pub views: [Option<LightPicture>; 2],
}

/// A test image of the projector's own pixels that was photographed.
#[derive(Clone, Debug)]
pub struct FineShown {
    /// Its number in `verify.csv`.
    pub image: u8,
    /// The light that was wanted, relative to reference white; without the projector's border.
    pub wanted: LightPicture,
    /// The same, compensated: codes for the projector.
    pub compensated: Picture,
    /// Share of its samples that the table has to cut.
    pub clipped: f64,
}

impl FineShown {
    /// Whether the projector's range may have cut each sample of the compensated picture.
    pub(super) fn cut(&self, channel: usize) -> Vec<bool> {
        let Samples::Eight(samples) = self.compensated.samples() else {
            unreachable!("`read_of_size` takes 8 bits only");
        };
        let channels = self.compensated.channels();
        let codes = samples.iter().skip(channel).step_by(channels);
        codes.map(|code| [0, u8::MAX].contains(code)).collect()
    }
}

/// Everything that the photographs of a verification folder say.
#[derive(Clone, Debug)]
pub struct Readings {
    /// The test images, by number.
    pub shown: Vec<Shown>,
    /// Those of the projector's own pixels, by number; [`CellReadings::pixels`] has the
    /// photographs of each, as it is and compensated.
    pub fine: Vec<FineShown>,
    /// The cells, white and black.
    pub revisited: CellReadings,
    /// Cells that the table has gains for and that were measured, length `N`.
    pub live: Vec<bool>,
    /// Whether a chain that compensates was given the wanted images.
    pub wanted: bool,
    /// The projector's input under what stands for white, relative to its white.
    pub flood: CellPlanes,
    /// Light under white when the table was made, camera units, where photographs say it; otherwise
    /// the table does.
    pub expected_white: Option<CellPlanes>,
    /// How far pictures that overlap lie from where they lay against each other when the table was
    /// made.
    pub shifts: Vec<PictureShift>,
    /// Two projectors, from 0, that show each other's pictures.
    pub exchanged: Option<[usize; 2]>,
    /// Pairs of projectors, from 0, whose overlap these photographs do not show.
    pub unseen: Vec<[usize; 2]>,
}

/// Share of the table's cells that must be found.
const LEAST_FOUND: f64 = 0.5;

impl Readings {
    /// Reads the folder that was made with `table`.
    ///
    /// # Errors
    /// [`VerifyError`] for whatever is missing, contradictory or unusable.
    pub fn read(
        folder: &Path,
        table: &Table<'_>,
        progress: &dyn Progress,
    ) -> Result<Self, VerifyError> {
        let manifest = VerifyManifest::read(folder).map_err(|error| match error {
            CaptureError::NoManifest { .. } => VerifyError::NoManifest {
                path: folder.to_owned(),
            },
            other => other.into(),
        })?;
        if folder.join(projector_file(1)).exists() {
            return several::read(folder, manifest, table, progress);
        }
        let settings = Settings::read(folder)?;
        let mixing = Provenance::read(table.provenance()).mixing;
        let mut code: Vec<Shot> = Vec::new();
        let mut images: BTreeMap<u8, [Option<VerifyShot>; 2]> = BTreeMap::new();
        let mut fine_images: BTreeMap<u8, [Option<VerifyShot>; 2]> = BTreeMap::new();
        let mut wanted = false;
        for shot in manifest.shots {
            match shot.role {
                VerifyRole::Code(role) => code.push(with_role(&shot, role)),
                VerifyRole::Plain(image) => images.entry(image).or_default()[0] = Some(shot),
                VerifyRole::Compensated(image) => images.entry(image).or_default()[1] = Some(shot),
                VerifyRole::FinePlain(image) => {
                    fine_images.entry(image).or_default()[0] = Some(shot);
                }
                VerifyRole::FineCompensated(image) => {
                    fine_images.entry(image).or_default()[1] = Some(shot);
                }
                VerifyRole::Wanted(image) => {
                    wanted = true;
                    images.insert(image, [Some(shot.clone()), Some(shot)]);
                }
            }
        }
        let path = || folder.join(VERIFY_FILE);
        if images.is_empty() {
            return Err(VerifyError::NoImages { path: path() });
        }
        let pairs = paired(images, folder)?;
        let fine_pairs = paired(fine_images, folder)?;
        check_all_there(folder, &code, [&pairs, &fine_pairs].into_iter().flatten())?;
        let fine = fine_pictures(folder, table, &settings, &fine_pairs)?;
        let pictures = if wanted {
            wanted_pictures(folder, table, &pairs)?
        } else {
            pictures(folder, table, &pairs)?
        };
        // Of the shots of pictures, only photograph and line are looked at.
        let flat = pairs
            .iter()
            .flat_map(|(_, pair)| &pair[usize::from(wanted)..]);
        let shots: Vec<Shot> = flat
            .map(|shot| with_role(shot, iltm_capture::Role::White))
            .collect();
        let fine_shots: Vec<Shot> = (fine_pairs.iter().flat_map(|(_, pair)| pair))
            .map(|shot| with_role(shot, iltm_capture::Role::White))
            .collect();
        let photographs = Remeasured {
            code: &code,
            pictures: &shots,
            fine: &fine_shots,
        };
        let revisited = remeasure(folder, &settings, mixing, photographs, progress)?;
        let live = live(folder, table, &revisited)?;
        let tests = test_images(table)?;
        let test = |image: u8| tests.get(usize::from(image));
        let mut expected = Expected::new(table);
        let photographed = if wanted { 1 } else { 2 };
        let mut shown = Vec::with_capacity(pairs.len());
        for (at, ((image, pair), picture)) in pairs.into_iter().zip(pictures).enumerate() {
            let last = photographed * (at + 1) - 1;
            let first = photographed * at;
            let view = |at: usize| revisited.views.get(at).cloned();
            let plain = if wanted {
                let light = expected.photograph(&picture.input[0]);
                light.ok_or_else(|| VerifyError::Untold { path: path() })?
            } else {
                revisited.pictures[first].clone()
            };
            shown.push(Shown {
                image,
                title: test(image)
                    .map_or_else(|| "Test image".to_owned(), |test| test.title.clone()),
                clipped: test(image).map_or(0.0, |test| test.clipped),
                wanted: picture.wanted,
                input: picture.input,
                seen: [plain, revisited.pictures[last].clone()],
                photos: pair.map(|shot| shot.photo),
                views: [view(first).filter(|_| !wanted), view(last)],
            });
        }
        Ok(Self {
            shown,
            fine,
            live,
            flood: flood(table, wanted)?,
            wanted,
            revisited,
            expected_white: None,
            shifts: Vec::new(),
            exchanged: None,
            unseen: Vec::new(),
        })
    }
}

/// Both pictures of each test image.
pub(super) fn paired(
    images: BTreeMap<u8, [Option<VerifyShot>; 2]>,
    folder: &Path,
) -> Result<Vec<(u8, [VerifyShot; 2])>, VerifyError> {
    let pair = |(image, [own, compensated]): (u8, [Option<VerifyShot>; 2])| {
        let lacking = |what| VerifyError::Unpaired {
            path: folder.join(VERIFY_FILE),
            image,
            what,
        };
        let own = own.ok_or_else(|| lacking("plain"))?;
        let compensated = compensated.ok_or_else(|| lacking("compensated"))?;
        Ok((image, [own, compensated]))
    };
    images.into_iter().map(pair).collect()
}

/// The projector's input under what stands for white.
fn flood(table: &Table<'_>, wanted: bool) -> Result<CellPlanes, VideoError> {
    let cells = table.grid().cells();
    if !wanted {
        return Ok(vec![vec![1.0; cells]; table.channels().into()]);
    }
    let compensator = Compensator::new(table, iltm_video::CompensateOptions::default())?;
    let mut white = grey(table, levels(table)?, &vec![true; cells]);
    compensator.picture(&mut white)?;
    Ok(input(&white, &ProjectorCurves::new(table)))
}

/// What the pictures of a folder of wanted images say, and what this table makes of them.
fn wanted_pictures(
    folder: &Path,
    table: &Table<'_>,
    pairs: &[(u8, [VerifyShot; 2])],
) -> Result<Vec<Pictures>, VerifyError> {
    let path = folder.join(TABLE_FILE);
    let own = format!("{:08x}", table.id());
    let made_with = foreign_file::read_text(&path, 64).unwrap_or_default();
    if made_with.trim() != own {
        return Err(VerifyError::NotOfTable { path, own });
    }
    let curves = ProjectorCurves::new(table);
    let compensator = Compensator::new(table, iltm_video::CompensateOptions::default())?;
    let of_image = |(image, _): &(u8, [VerifyShot; 2])| {
        let wanted = read(folder, &wanted_file(*image), table)?;
        let mut made = wanted.clone();
        compensator.picture(&mut made)?;
        Ok(Pictures {
            wanted: light(&wanted_light(&wanted, table)),
            // Who does not compensate sends the codes as they are.
            input: [&wanted, &made].map(|picture| input(picture, &curves)),
        })
    };
    pairs.iter().map(of_image).collect()
}

pub(super) fn with_role(shot: &VerifyShot, role: iltm_capture::Role) -> Shot {
    Shot {
        index: shot.index,
        role,
        pattern: shot.pattern.clone(),
        photo: shot.photo.clone(),
        exposure: shot.exposure,
        line: shot.line,
    }
}

pub(super) fn check_all_there<'p>(
    folder: &Path,
    code: &[Shot],
    pairs: impl Iterator<Item = &'p (u8, [VerifyShot; 2])>,
) -> Result<(), VerifyError> {
    let of_code = code.iter().map(|shot| (shot.index, &shot.photo));
    let of_images = pairs.flat_map(|(_, pair)| pair);
    let of_images = of_images.map(|shot| (shot.index, &shot.photo));
    let mut missing = Vec::new();
    for (index, photo) in of_code.chain(of_images) {
        if find_photo(folder, photo)?.is_none() {
            missing.push((index, photo));
        }
    }
    missing.sort();
    if missing.is_empty() {
        return Ok(());
    }
    Err(VerifyError::Missing {
        folder: folder.to_owned(),
        missing: missing
            .into_iter()
            .map(|(_, photo)| photo.clone())
            .collect(),
    })
}

/// What the pictures of a test image say.
struct Pictures {
    wanted: CellPlanes,
    input: [CellPlanes; 2],
}

/// Reads the pictures and makes sure that they are what this table makes.
fn pictures(
    folder: &Path,
    table: &Table<'_>,
    pairs: &[(u8, [VerifyShot; 2])],
) -> Result<Vec<Pictures>, VerifyError> {
    let curves = ProjectorCurves::new(table);
    let compensator = Compensator::new(table, iltm_video::CompensateOptions::default())?;
    let of_pair = |(image, [own, compensated]): &(u8, [VerifyShot; 2])| {
        let wanted = read(folder, &wanted_file(*image), table)?;
        let given = [
            read(folder, &own.pattern, table)?,
            read(folder, &compensated.pattern, table)?,
        ];
        let mut made = wanted.clone();
        compensator.picture(&mut made)?;
        let expected = [plain(&wanted, &curves), made];
        let shots = [own, compensated];
        for ((given, expected), shot) in given.iter().zip(&expected).zip(shots) {
            if given != expected {
                return Err(VerifyError::OtherTable {
                    path: folder.join(&shot.pattern),
                    image: *image,
                });
            }
        }
        Ok(Pictures {
            wanted: light(&wanted_light(&wanted, table)),
            input: given.map(|picture| input(&picture, &curves)),
        })
    };
    pairs.iter().map(of_pair).collect()
}

/// The light of a picture, with black as bright as the table makes it.
fn wanted_light(wanted: &Picture, table: &Table<'_>) -> LightPicture {
    LightPicture::decode(wanted, Response::Srgb).raised(table.black().to_num())
}

/// The same of test images of the projector's own pixels.
pub(super) fn fine_pictures(
    folder: &Path,
    table: &Table<'_>,
    settings: &Settings,
    pairs: &[(u8, [VerifyShot; 2])],
) -> Result<Vec<FineShown>, VerifyError> {
    if pairs.is_empty() {
        return Ok(Vec::new());
    }
    let [width, height] = settings.projector.size.unwrap_or_default();
    let size = FrameSize::new(width, height).unwrap_or(FrameSize::of_grid(table.grid()));
    let layout = Layout::new(table.grid(), size, settings.projector.border)?;
    let curves = ProjectorCurves::new(table);
    let compensator = Compensator::new(table, iltm_video::CompensateOptions::default())?;
    let of_pair = |(image, shots): &(u8, [VerifyShot; 2])| {
        let wanted = read_of_size(folder, &fine_file(*image), table, layout.inner())?;
        let mut made = wanted.clone();
        let summary = compensator.picture(&mut made)?;
        let expected = [&plain(&wanted, &curves), &made];
        for (shot, expected) in shots.iter().zip(expected) {
            let given = read_of_size(folder, &shot.pattern, table, size)?;
            if layout.framed(expected).as_ref() != Some(&given) {
                return Err(VerifyError::OtherTable {
                    path: folder.join(&shot.pattern),
                    image: *image,
                });
            }
        }
        Ok(FineShown {
            image: *image,
            wanted: wanted_light(&wanted, table),
            compensated: made,
            clipped: summary.clipped as f64 / summary.samples.max(1) as f64,
        })
    };
    pairs.iter().map(of_pair).collect()
}

/// A picture of one pixel a cell, 8 bits, as many channels as the table.
fn read(folder: &Path, name: &Path, table: &Table<'_>) -> Result<Picture, VerifyError> {
    read_of_size(folder, name, table, FrameSize::of_grid(table.grid()))
}

/// The same of another size.
fn read_of_size(
    folder: &Path,
    name: &Path,
    table: &Table<'_>,
    expected: FrameSize,
) -> Result<Picture, VerifyError> {
    let path = folder.join(name);
    let file = foreign_file::open(&path).map_err(|source| {
        if source.kind() == ErrorKind::NotFound {
            let missing = vec![name.to_owned()];
            let folder = folder.to_owned();
            return VerifyError::Missing { folder, missing };
        }
        let path = path.clone();
        VerifyError::Capture(CaptureError::Io { path, source })
    })?;
    let picture = png::read(BufReader::new(file)).map_err(VideoError::Png)?;
    let (grid, size) = (table.grid(), picture.size());
    if size != expected {
        return Err(VerifyError::Grid {
            path,
            found: format!("{} x {}", size.height(), size.width()),
            expected: if expected == FrameSize::of_grid(grid) {
                grid.to_string()
            } else {
                format!("{} x {} pixels", expected.height(), expected.width())
            },
        });
    }
    let suits = picture.channels() == usize::from(table.channels());
    if !suits || !matches!(picture.samples(), Samples::Eight(_)) {
        return Err(VerifyError::Picture {
            path,
            channels: table.channels(),
        });
    }
    Ok(picture)
}

fn light(picture: &LightPicture) -> CellPlanes {
    let plane = |plane: &Vec<f32>| plane.iter().map(|light| f64::from(*light)).collect();
    picture.planes().iter().map(plane).collect()
}

/// The projector's input that codes stand for.
pub(super) fn input(picture: &Picture, curves: &ProjectorCurves) -> CellPlanes {
    let Samples::Eight(samples) = picture.samples() else {
        unreachable!("`read` takes 8 bits only");
    };
    let channels = picture.channels();
    let plane = |channel: usize| {
        let codes = samples.iter().skip(channel).step_by(channels);
        codes.map(|code| curves.drive(channel, *code)).collect()
    };
    (0..channels).map(plane).collect()
}

/// The cells that can be compared.
pub(super) fn live(
    folder: &Path,
    table: &Table<'_>,
    revisited: &CellReadings,
) -> Result<Vec<bool>, VerifyError> {
    let path = || folder.to_owned();
    if revisited.grid != table.grid() {
        return Err(VerifyError::Grid {
            path: path(),
            found: revisited.grid.to_string(),
            expected: table.grid().to_string(),
        });
    }
    let channels = usize::from(table.channels());
    if revisited.channels != channels {
        return Err(VerifyError::Channels {
            path: path(),
            photographs: revisited.channels,
            table: channels,
        });
    }
    let known = Expected::new(table).live();
    let both = known.iter().zip(&revisited.live);
    let live: Vec<bool> = both.map(|(known, seen)| *known && *seen).collect();
    let count = |cells: &[bool]| cells.iter().filter(|live| **live).count();
    let too_few = (count(&live) as f64) < LEAST_FOUND * count(&known) as f64 || count(&live) == 0;
    if let (true, Some((Cause::Clipped, gate))) = (too_few, refused(revisited)) {
        return Err(VerifyError::Overexposed {
            path: path(),
            what: gate.what.clone(),
        });
    }
    if too_few {
        return Err(VerifyError::TooFewCells {
            path: path(),
            found: count(&live),
            live: count(&known),
        });
    }
    Ok(live)
}
