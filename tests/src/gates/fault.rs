//! Faults of a session, the smallest size that the gates promise to find, and what they must say.

use iltm::capture::{Gate, GateName, Verdict};
use iltm::scene::CaptureFault;

/// A fault that the study makes.
#[derive(Clone, Copy, Debug)]
pub struct StudiedFault {
    /// What happens.
    pub kind: CaptureFault,
    /// Its smallest size that is promised to be found; of places, none.
    pub size: f64,
    /// The size in words.
    pub words: &'static str,
}

impl StudiedFault {
    /// All faults, each at the smallest size that the gates' page promises.
    pub const ALL: [Self; 9] = [
        Self::new(
            CaptureFault::Gamma,
            1.3,
            "gamma of the camera, of the declared one",
        ),
        Self::new(
            CaptureFault::AutoExposure,
            0.1,
            "part of the brightness evened out",
        ),
        Self::new(CaptureFault::Tripod, 0.1, "of a cell's side"),
        Self::new(CaptureFault::Swapped, 0.0, "anywhere"),
        Self::new(CaptureFault::Dropped, 0.0, "anywhere"),
        Self::new(CaptureFault::Skipped, 0.0, "anywhere"),
        Self::new(CaptureFault::Clipped, 2.0, "times the exposure"),
        Self::new(
            CaptureFault::Vivid,
            0.15,
            "of the light that a dark picture loses",
        ),
        Self::new(CaptureFault::Flicker, 0.06, "amplitude of the bands"),
    ];

    const fn new(kind: CaptureFault, size: f64, words: &'static str) -> Self {
        Self { kind, size, words }
    }

    /// Whether the first gate that fails is the right one, and its next step too.
    pub fn found(self, gates: &[Gate]) -> bool {
        let first = gates.iter().find(|gate| gate.fails());
        let (names, steps) = named_by(self.kind);
        first.is_some_and(|gate| {
            names.contains(&gate.name) && steps.iter().any(|step| gate.next_step.contains(step))
        })
    }

    /// Whether nothing fails because a gate that is meant to find it says that it cannot judge.
    pub fn left_open(self, gates: &[Gate]) -> bool {
        let (names, _) = named_by(self.kind);
        let open = |gate: &Gate| names.contains(&gate.name) && gate.verdict == Verdict::NotJudged;
        gates.iter().any(open) && !gates.iter().any(Gate::fails)
    }

    /// Whether a gate has a remark at least.
    pub fn noticed(gates: &[Gate]) -> bool {
        gates.iter().any(|gate| gate.verdict >= Verdict::Warn)
    }
}

/// Gates of which the first that fails must be one, and words of which its next step must
/// have one.
pub fn named_by(kind: CaptureFault) -> (&'static [GateName], &'static [&'static str]) {
    use GateName as G;
    match kind {
        CaptureFault::Gamma => (&[G::Superposition, G::Response], &["[camera] response"]),
        CaptureFault::AutoExposure => (&[G::Superposition], &["Set exposure"]),
        CaptureFault::Tripod => (&[G::Movement], &["take the capture again"]),
        CaptureFault::Swapped => (&[G::Order], &["Exchange the two files"]),
        CaptureFault::Dropped => (&[G::Complete], &["Take the missing photographs"]),
        CaptureFault::Skipped => (
            &[G::Order],
            &[
                "one higher for each missing one",
                "Take those photographs again",
            ],
        ),
        CaptureFault::Clipped => (&[G::Saturation], &["shorter exposure"]),
        CaptureFault::Vivid => (&[G::Superposition, G::Response], &["projector's"]),
        CaptureFault::Flicker => (&[G::Flicker], &["longer exposure"]),
    }
}
