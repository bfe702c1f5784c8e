//! Recognising photographs of a film: which slide each of them shows, by the card that was
//! photographed before it, so that they may have any names and be more than are needed.

use super::VerifyError;
use super::card::Card;
use super::folder::PHOTOS_FOLDER;
use super::manifest::VerifyManifest;
use iltm_capture::{CaptureError, FileFormat, grey_view};
use iltm_picture::{FolderError, LightPicture, WholeFolder, progress::Progress};
use iltm_runtime::image::Table;
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Pixels along a side of a photograph in which cards are looked for.
const CARD_SIDE: usize = 2_000;

/// How often a side of those is halved to compare a photograph with the next one.
const HALVINGS: usize = 3;

/// Two photographs show one picture if their pixels differ by at most this, on average and
/// relative to their light. Noise, at most one per cent, is less; a change of the picture is more.
const ALIKE: f64 = 0.015;

/// Light of a photograph, relative to the brightest, below which it counts as that much.
const DARK: f64 = 0.25;

/// What was found in a folder of photographs.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Recognised {
    /// Photographs looked at.
    pub photographs: usize,
    /// Those of them that show a card.
    pub cards: usize,
    /// Slides that were recognised.
    pub slides: usize,
}

/// One photograph.
struct Seen {
    path: PathBuf,
    card: Option<Card>,
    small: LightPicture,
}

/// Photographs between one card and the next.
struct Group<'a> {
    slide: u32,
    photographs: Vec<&'a Seen>,
    /// Whether the card of the following slide came next, so that none was overlooked.
    whole: bool,
}

/// Finds which slides of a verification folder the photographs in `from` show, in the order
/// of the numbers in their names, and copies one of each into the folder.
///
/// # Errors
/// [`VerifyError`] if there are photographs in the folder already, if a photograph cannot be
/// read, if none shows a card of this table's film, or if a slide is not recognised; nothing
/// is copied then.
pub fn recognise(
    folder: &Path,
    from: &Path,
    table: &Table<'_>,
    progress: &dyn Progress,
) -> Result<Recognised, VerifyError> {
    let manifest = VerifyManifest::read(folder)?;
    let copies = WholeFolder::create(&folder.join(PHOTOS_FOLDER)).map_err(|error| match error {
        FolderError::Taken { path } => VerifyError::Photographed { path },
        error => error.into(),
    })?;
    let photographs = look_at_all(from, progress)?;
    let cards = photographs.iter().filter_map(|seen| seen.card);
    let (own, others): (Vec<Card>, Vec<Card>) = cards.partition(|card| card.table == table.id());
    if own.is_empty() {
        return Err(VerifyError::NoCards {
            folder: from.to_owned(),
            photographs: photographs.len(),
            other: others.first().map(|card| format!("{:08x}", card.table)),
        });
    }
    let light = photographs.iter().map(|seen| pixels(&seen.small).sum());
    let brightest = light.fold(0.0, f64::max);
    let mut known: BTreeMap<u32, &Seen> = BTreeMap::new();
    for group in groups(&photographs, table.id()) {
        if let Some(seen) = group.shows(brightest) {
            known.entry(group.slide).or_insert(seen);
        }
    }
    let slides = manifest.shots.iter().map(|shot| shot.index);
    let missing: Vec<u32> = slides.filter(|at| !known.contains_key(at)).collect();
    if !missing.is_empty() {
        let had_card = |index: &u32| own.iter().any(|card| card.slide == *index);
        let (unclear, unseen) = missing.into_iter().partition(had_card);
        return Err(VerifyError::Unrecognised {
            folder: from.to_owned(),
            unseen,
            unclear,
        });
    }
    for shot in &manifest.shots {
        let (Some(seen), Some(name)) = (known.get(&shot.index), shot.photo.file_name()) else {
            continue;
        };
        let extension = seen.path.extension().unwrap_or_default();
        let photograph = std::fs::read(&seen.path).map_err(FolderError::io(&seen.path))?;
        copies.file(Path::new(name).with_extension(extension), photograph)?;
    }
    copies.finish()?;
    Ok(Recognised {
        photographs: photographs.len(),
        cards: own.len(),
        slides: manifest.shots.len(),
    })
}

/// All pictures of a folder, in the order of the numbers in their names.
fn look_at_all(from: &Path, progress: &dyn Progress) -> Result<Vec<Seen>, VerifyError> {
    let io = |source| CaptureError::Io {
        path: from.to_owned(),
        source,
    };
    let mut paths = Vec::new();
    for entry in std::fs::read_dir(from).map_err(io)? {
        let path = entry.map_err(io)?.path();
        let extension = path.extension().unwrap_or_default().to_string_lossy();
        let mut known = FileFormat::EXTENSIONS.iter();
        if known.any(|known| extension.eq_ignore_ascii_case(known)) {
            paths.push(path);
        }
    }
    alphanumeric_sort::sort_path_slice(&mut paths);
    progress.begin("looking for cards", paths.len() as u64);
    let look = |path: &PathBuf| {
        let view = grey_view(path, CARD_SIDE)?;
        let card = Card::read(&view);
        let mut small = view;
        for _ in 0..HALVINGS {
            small = small.halved();
        }
        progress.advance(1);
        Ok(Seen {
            path: path.clone(),
            card,
            small,
        })
    };
    let seen = paths.par_iter().map(look);
    let seen = seen.collect::<Result<Vec<_>, VerifyError>>()?;
    progress.end();
    Ok(seen)
}

/// The photographs after each card of this table, up to the next card of any.
fn groups(photographs: &[Seen], table: u32) -> Vec<Group<'_>> {
    let mut groups: Vec<Group<'_>> = Vec::new();
    let mut open = false;
    for seen in photographs {
        match seen.card {
            Some(card) if card.table == table => {
                if let Some(last) = groups.last_mut().filter(|_| open) {
                    last.whole = card.slide.checked_sub(1) == Some(last.slide);
                    // The card itself was photographed twice.
                    if card.slide == last.slide && last.photographs.is_empty() {
                        continue;
                    }
                }
                open = true;
                groups.push(Group {
                    slide: card.slide,
                    photographs: Vec::new(),
                    whole: false,
                });
            }
            Some(_) => open = false,
            None => {
                if let Some(last) = groups.last_mut().filter(|_| open) {
                    last.photographs.push(seen);
                }
            }
        }
    }
    groups
}

impl<'a> Group<'a> {
    /// The photograph that shows the slide; `None` if that cannot be told.
    ///
    /// One that was taken while the picture changed is unlike those beside it, and so is a
    /// card that could not be read with its slide, if the following card is not the next.
    fn shows(&self, brightest: f64) -> Option<&'a Seen> {
        let runs: Vec<&[&Seen]> = (self.photographs)
            .chunk_by(|a, b| alike(a, b, brightest))
            .collect();
        let longest = runs.iter().map(|run| run.len()).max()?;
        let mut candidates = runs.iter().filter(|run| run.len() == longest);
        let run = candidates.next()?;
        let sure = runs.len() == 1 || (self.whole && longest > 1 && candidates.next().is_none());
        sure.then(|| run.get(run.len() / 2).copied()).flatten()
    }
}

/// Whether two photographs show the same picture; dark ones, whose noise is all they have, by
/// the light of the brightest.
fn alike(a: &Seen, b: &Seen, brightest: f64) -> bool {
    let pairs = pixels(&a.small).zip(pixels(&b.small));
    let apart: f64 = pairs.map(|(a, b)| (a - b).abs()).sum();
    let light = pixels(&a.small).sum::<f64>().max(pixels(&b.small).sum());
    a.small.size() == b.small.size() && apart <= ALIKE * light.max(DARK * brightest)
}

fn pixels(picture: &LightPicture) -> impl Iterator<Item = f64> {
    picture.planes().iter().flatten().map(|&light| light.into())
}

#[cfg(test)]
mod tests {
    use super::*;
    use iltm_runtime::FrameSize;

    const TABLE: u32 = 7;

    /// A photograph of a card, or of a picture whose light is different for each number.
    fn seen(name: &str) -> Seen {
        let of = |prefix: &str| name.strip_prefix(prefix).and_then(|n| n.parse().ok());
        let card = |table, slide: Option<u32>| slide.map(|slide| Card { table, slide });
        let number: u32 = name.trim_matches(char::is_alphabetic).parse().unwrap();
        let size = FrameSize::new(4, 4).unwrap();
        // Noise of a photograph.
        let noise = 0.001 * name.len() as f32;
        let light = |_, at: usize| {
            0.2 + noise
                + if at as u32 % 7 == number % 7 {
                    0.3
                } else {
                    0.0
                }
        };
        Seen {
            path: name.into(),
            card: card(TABLE, of("card")).or(card(TABLE + 1, of("other"))),
            small: LightPicture::from_fn(size, 1, light),
        }
    }

    /// Which photograph shows which slide, of photographs in this order.
    fn shown(names: &str) -> Vec<(u32, Option<String>)> {
        let photographs: Vec<Seen> = names.split_whitespace().map(seen).collect();
        let name = |seen: &Seen| seen.path.display().to_string();
        let groups = groups(&photographs, TABLE);
        let of = |group: &Group<'_>| (group.slide, group.shows(4.0).map(name));
        groups.iter().map(of).collect()
    }

    fn is(slide: u32, photograph: &str) -> (u32, Option<String>) {
        (slide, Some(photograph.to_owned()))
    }

    #[test]
    fn a_slide_is_what_follows_its_card_however_often_either_was_photographed() {
        assert_eq!(shown("card3 a3 card4 a4"), [is(3, "a3"), is(4, "a4")]);
        assert_eq!(
            shown("card3 card3 a3 a3 a3 card4"),
            [is(3, "a3"), (4, None)]
        );
        // Nothing is known before the first card, and nothing after another film's.
        assert_eq!(shown("a9 card3 a3 other4 a4"), [is(3, "a3")]);
    }

    #[test]
    fn a_photograph_of_a_change_is_left_out_where_it_can_be_told() {
        assert_eq!(shown("card3 b1 a3 a3 card4"), [is(3, "a3"), (4, None)]);
        assert_eq!(shown("card3 a3 a3 b1 card4"), [is(3, "a3"), (4, None)]);
        // One of each: which is the slide?
        assert_eq!(shown("card3 b1 a3 card4"), [(3, None), (4, None)]);
        assert_eq!(shown("card3 a3 a3 b1 b1 card4"), [(3, None), (4, None)]);
    }

    #[test]
    fn a_card_that_was_not_read_spoils_its_slide_and_no_other() {
        // What follows card 3 is slide 3, the overlooked card 4 and slide 4.
        let overlooked = shown("card3 a3 b2 b2 a4 card5 a5");
        assert_eq!(overlooked, [(3, None), is(5, "a5")]);
        // A player that shows the slides in any order does no harm.
        assert_eq!(shown("card9 a9 a9 card2 a2"), [is(9, "a9"), is(2, "a2")]);
    }
}
