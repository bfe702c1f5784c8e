//! Exposure brackets: photographs of one pattern with different exposures.
//!
//! The k-th photograph of each exposure belong together. Light is in units of the full
//! scale at the longest exposure of the capture, so that of a short one may be above 1.

use super::error::CaptureError;
use super::manifest::{LINE, Shot, ShotOf};
use super::pattern::Pattern;
use super::role::Role;
use std::path::Path;

/// Photographs that become one.
#[derive(Clone, PartialEq, Debug)]
pub(crate) struct Bracket {
    /// The photographs, the longest exposure first; at least one.
    pub(crate) shots: Vec<Shot>,
    /// Exposure of each, relative to the longest of the capture.
    pub(crate) times: Vec<f64>,
}

impl Bracket {
    /// A bracket for each shot. `longest` is the exposure that light is relative to;
    /// without one, exposures do not count.
    pub(crate) fn of_each(shots: &[Shot], longest: Option<f64>) -> Vec<Self> {
        let each = shots
            .iter()
            .map(|shot| Self::new(vec![shot.clone()], longest));
        each.collect()
    }

    /// A bracket for each shot of another list. `longest` is the exposure that the capture's light
    /// is relative to; without one, it is the longest of the list.
    ///
    /// # Errors
    /// As [`longest`].
    pub(crate) fn of_list<R>(
        shots: &[ShotOf<R>],
        list: &Path,
        longest: Option<f64>,
    ) -> Result<Vec<Self>, CaptureError> {
        // What was shown does not matter to how it is read.
        let shots = shots.iter().map(|shot| shot.with_role(Role::White));
        let shots: Vec<Shot> = shots.collect();
        let own = self::longest(&shots, list)?;
        Ok(Self::of_each(&shots, longest.or(own)))
    }

    fn new(shots: Vec<Shot>, longest: Option<f64>) -> Self {
        let time = |shot: &Shot| match (shot.exposure, longest) {
            (Some(exposure), Some(longest)) => exposure / longest,
            _ => 1.0,
        };
        Self {
            times: shots.iter().map(time).collect(),
            shots,
        }
    }
}

/// The longest exposure of the shots; `None` if none is given.
///
/// # Errors
/// [`CaptureError::ManifestLine`] with the first shot that has none, if others
/// have: their light could not be compared.
pub(crate) fn longest(shots: &[Shot], manifest: &Path) -> Result<Option<f64>, CaptureError> {
    let given = shots.iter().filter_map(|shot| shot.exposure);
    let Some(longest) = given.reduce(f64::max) else {
        return Ok(None);
    };
    match shots.iter().find(|shot| shot.exposure.is_none()) {
        Some(shot) => Err(CaptureError::ManifestLine {
            path: manifest.to_owned(),
            line: shot.line,
            reason: "no exposure is given here, though other lines have one".to_owned(),
            next_step: LINE,
        }),
        None => Ok(Some(longest)),
    }
}

/// Puts the photographs of each bracket together. `patterns` are those of `shots`;
/// the brackets are in the order of their first photographs.
pub(crate) fn bracketed(shots: &[Shot], patterns: &[Pattern], longest: f64) -> Vec<Bracket> {
    let alike = |a: usize, b: usize| shots[a].role == shots[b].role && patterns[a] == patterns[b];
    let exposed = |a: usize, b: usize| shots[a].exposure == shots[b].exposure;
    let mut groups: Vec<Vec<usize>> = Vec::new();
    for shot in 0..shots.len() {
        // The first bracket of this pattern that lacks this exposure.
        let open = groups.iter_mut().find(|group| {
            alike(group[0], shot) && !group.iter().any(|&other| exposed(other, shot))
        });
        match open {
            Some(group) => group.push(shot),
            None => groups.push(vec![shot]),
        }
    }
    let together = |group: Vec<usize>| {
        let mut of: Vec<Shot> = group.into_iter().map(|at| shots[at].clone()).collect();
        of.sort_by(|a, b| {
            b.exposure
                .partial_cmp(&a.exposure)
                .unwrap_or(std::cmp::Ordering::Equal)
        });
        Bracket::new(of, Some(longest))
    };
    groups.into_iter().map(together).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Role;

    fn shot(index: u32, role: Role, exposure: Option<f64>) -> Shot {
        Shot {
            index,
            role,
            pattern: "p".into(),
            photo: "q".into(),
            exposure,
            line: u64::from(index) + 2,
        }
    }

    fn pattern(lit: bool) -> Pattern {
        Pattern {
            rows: 1,
            cols: 1,
            lit: vec![lit],
        }
    }

    #[test]
    fn the_kth_photographs_of_each_exposure_are_a_bracket() {
        let exposures = [1.0, 4.0, 1.0, 1.0, 4.0, 4.0];
        let roles = [
            Role::White,
            Role::White,
            Role::Black,
            Role::White,
            Role::White,
            Role::Black,
        ];
        let shots: Vec<Shot> = (0..6)
            .map(|k| shot(k as u32, roles[k], Some(exposures[k])))
            .collect();
        let patterns: Vec<_> = roles
            .iter()
            .map(|role| pattern(*role == Role::White))
            .collect();
        let longest = longest(&shots, Path::new("c")).unwrap().unwrap();
        let brackets = bracketed(&shots, &patterns, longest);
        let indices = |bracket: &Bracket| bracket.shots.iter().map(|s| s.index).collect::<Vec<_>>();
        assert_eq!(
            brackets.iter().map(indices).collect::<Vec<_>>(),
            [[1, 0], [5, 2], [4, 3]]
        );
        assert!(brackets.iter().all(|bracket| bracket.times == [1.0, 0.25]));
    }

    #[test]
    fn an_exposure_that_only_some_lines_have_is_refused() {
        let shots = [shot(0, Role::White, Some(1.0)), shot(1, Role::Black, None)];
        let error = longest(&shots, Path::new("c.csv")).unwrap_err().to_string();
        assert!(error.starts_with("c.csv, line 3: no exposure"), "{error}");
        assert_eq!(longest(&shots[1..], Path::new("c.csv")).unwrap(), None);
    }
}
