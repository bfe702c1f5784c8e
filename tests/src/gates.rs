//! Which gates notice a fault of which size: photographs of a described scene are taken
//! with the fault on purpose, and every gate is asked.

use iltm::capture::{self, CaptureOptions, Gate, GateName, Verdict, pattern_set};
use iltm::progress::Silent;
use iltm::scene::description::Scene;
use iltm::scene::{Fault, Mishap, Shooting, Simulation, SimulationOptions, folder};
use std::fmt::Write;

/// Seed of patterns and noise.
const SEED: u64 = 1;

/// Bernoulli photographs of each session.
const BERNOULLI: usize = 60;

/// What the gates say of one session.
#[derive(Clone, Debug)]
pub struct Session {
    /// The fault, with its size.
    pub fault: Option<Fault>,
    /// All gates.
    pub gates: Vec<Gate>,
}

impl Session {
    /// The gates with this verdict.
    #[must_use]
    pub fn that(&self, verdict: Verdict) -> Vec<GateName> {
        let that = self.gates.iter().filter(|gate| gate.verdict == verdict);
        that.map(|gate| gate.name).collect()
    }

    /// What the first gate that is not content says.
    #[must_use]
    pub fn first_words(&self) -> &str {
        let worst = self.gates.iter().find(|gate| gate.fails());
        let remark = || self.gates.iter().find(|g| g.verdict == Verdict::Warn);
        worst.or_else(remark).map_or("", |gate| gate.what.as_str())
    }
}

/// A scene to take photographs of.
pub struct Rig<'s> {
    scene: &'s Scene,
    simulation: Simulation<'s>,
}

impl<'s> Rig<'s> {
    /// Computes the light of a scene.
    ///
    /// # Panics
    /// If it cannot be simulated: the scenes are part of the project.
    #[must_use]
    pub fn new(scene: &'s Scene) -> Self {
        let options = SimulationOptions::default();
        let simulation = Simulation::new(scene, &options, &Silent).expect("can be simulated");
        Self { scene, simulation }
    }

    /// Takes photographs with a fault, or none, and asks the gates.
    ///
    /// # Panics
    /// If the photographs cannot be written or are no capture.
    #[must_use]
    pub fn session(&self, fault: Option<Fault>) -> Session {
        let folder = tempfile::tempdir().expect("a folder");
        let out = folder.path().join("capture");
        let shooting = Shooting::new(self.scene, &self.simulation, SEED).expect("light");
        let faults: Vec<Fault> = fault.into_iter().collect();
        let shooting = shooting.with_faults(&faults);
        let patterns = pattern_set(self.simulation.grid(), BERNOULLI, SEED);
        folder::write(&shooting, &patterns, &out, &Silent).expect("written");
        let examined = capture::examine(&out, &CaptureOptions::default(), &Silent);
        Session {
            fault,
            gates: examined.expect("a capture").gates,
        }
    }
}

/// Faults and the sizes that are tried, the smallest first.
#[must_use]
pub fn tried() -> Vec<(Mishap, &'static str, Vec<f64>)> {
    vec![
        (
            Mishap::Gamma,
            "gamma of the camera that nobody declared",
            vec![1.02, 1.05, 1.1, 1.15, 1.2, 1.4, 1.8, 2.2],
        ),
        (
            Mishap::AutoExposure,
            "part of the brightness evened out by automatic exposure",
            vec![0.01, 0.02, 0.03, 0.05, 0.1, 0.3, 1.0],
        ),
        (
            Mishap::Tripod,
            "bump of the tripod, pixels (a cell is 8 wide)",
            vec![0.05, 0.1, 0.2, 0.3, 0.5, 1.0, 3.0, 10.0],
        ),
        (
            Mishap::Swapped,
            "one exchanged pair, at this part of the session",
            vec![0.06, 0.15, 0.3, 0.6, 0.95],
        ),
        (
            Mishap::Dropped,
            "one file missing, at this part of the session",
            vec![0.06, 0.3, 0.6, 0.95],
        ),
        (
            Mishap::Skipped,
            "one photograph never taken, all others moved up, from this part on",
            vec![0.06, 0.15, 0.3, 0.6, 0.95],
        ),
        (
            Mishap::Clipped,
            "times the right exposure",
            vec![1.1, 1.2, 1.25, 1.3, 1.4, 1.6, 2.5],
        ),
        (
            Mishap::Vivid,
            "vivid mode: part of the light that a dark picture loses",
            vec![0.01, 0.02, 0.03, 0.05, 0.1, 0.15, 0.3],
        ),
        (
            Mishap::Flicker,
            "amplitude of bands of mains light",
            vec![0.002, 0.005, 0.01, 0.02, 0.03, 0.06, 0.15],
        ),
    ]
}

/// A table of what was noticed, a line for each fault.
#[must_use]
pub fn table(sessions: &[(&'static str, Vec<Session>)]) -> String {
    let mut text = String::from(
        "| fault | passes in silence | remark from | refused from | by |\n|---|---|---|---|---|\n",
    );
    for (what, sessions) in sessions {
        let size = |session: &Session| session.fault.map_or(0.0, |fault| fault.size);
        let fails = |session: &&Session| !session.that(Verdict::Fail).is_empty();
        let remarks = |session: &&Session| !session.that(Verdict::Warn).is_empty();
        let silent: Vec<String> = (sessions.iter())
            .filter(|session| !fails(session) && !remarks(session))
            .map(|session| size(session).to_string())
            .collect();
        let first = |of: &dyn Fn(&&Session) -> bool| {
            let found = sessions.iter().find(of);
            found.map_or_else(|| "-".to_owned(), |session| size(session).to_string())
        };
        let mut names: Vec<GateName> = (sessions.iter())
            .flat_map(|s| s.that(Verdict::Fail))
            .collect();
        names.sort();
        names.dedup();
        let names: Vec<String> = names.iter().map(|name| format!("`{name}`")).collect();
        let _ = writeln!(
            text,
            "| {what} | {} | {} | {} | {} |",
            if silent.is_empty() {
                "-".to_owned()
            } else {
                silent.join(", ")
            },
            first(&|session| remarks(session) && !fails(session)),
            first(&|session| fails(session)),
            names.join(", ")
        );
    }
    text
}
