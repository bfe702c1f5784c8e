//! Gates before a solve, and which of them notices a fault of which size: photographs of a
//! described scene are taken with the fault on purpose, and every gate is asked.

use crate::simulated::simulation;
use iltm::capture::{self, CaptureOptions, Gate, GateName, Verdict, pattern_set};
use iltm::progress::Silent;
use iltm::scene::description::Scene;
use iltm::scene::{CaptureFault, Forced, InjectedFault, Simulation, VirtualCamera, folder};
use std::fmt::Write;

/// Seed of patterns and noise.
const SEED: u64 = 1;

/// Bernoulli photographs of each session.
const BERNOULLI: usize = 60;

/// What the gates say of one session.
#[derive(Clone, Debug)]
pub struct GateSession {
    /// The fault, with its size.
    pub fault: Option<InjectedFault>,
    /// All gates.
    pub gates: Vec<Gate>,
}

impl GateSession {
    /// The gates with this verdict.
    pub fn that(&self, verdict: Verdict) -> Vec<GateName> {
        let that = self.gates.iter().filter(|gate| gate.verdict == verdict);
        that.map(|gate| gate.name).collect()
    }

    /// What the first gate that is not content says.
    pub fn first_words(&self) -> &str {
        let worst = self.gates.iter().find(|gate| gate.fails());
        let remark = || self.gates.iter().find(|g| g.verdict == Verdict::Warn);
        worst.or_else(remark).map_or("", |gate| gate.what.as_str())
    }
}

/// A scene to take photographs of.
pub struct GateRig<'s> {
    scene: &'s Scene,
    simulation: Simulation<'s>,
}

impl<'s> GateRig<'s> {
    /// Computes the light of a scene.
    pub fn new(scene: &'s Scene) -> Self {
        let simulation = simulation(scene, Forced::default());
        Self { scene, simulation }
    }

    /// Takes photographs with a fault, or none, and asks the gates.
    pub fn session(&self, fault: Option<InjectedFault>) -> GateSession {
        let folder = tempfile::tempdir().expect("a folder");
        let out = folder.path().join("capture");
        let camera = VirtualCamera::new(self.scene, &self.simulation, SEED).expect("light");
        let faults: Vec<InjectedFault> = fault.into_iter().collect();
        let camera = camera.with_faults(&faults);
        let patterns = pattern_set(self.simulation.grid(), BERNOULLI, SEED);
        folder::write(&camera, &patterns, &out, &Silent).expect("written");
        let examined = capture::examine(&out, &CaptureOptions::default(), &Silent);
        GateSession {
            fault,
            gates: examined.expect("a capture").gates,
        }
    }
}

/// Faults and the sizes that are tried, the smallest first.
pub fn tried() -> Vec<(CaptureFault, &'static str, Vec<f64>)> {
    vec![
        (
            CaptureFault::Gamma,
            "gamma of the camera that nobody declared",
            vec![1.02, 1.05, 1.1, 1.15, 1.2, 1.4, 1.8, 2.2],
        ),
        (
            CaptureFault::AutoExposure,
            "part of the brightness evened out by automatic exposure",
            vec![0.01, 0.02, 0.03, 0.05, 0.1, 0.3, 1.0],
        ),
        (
            CaptureFault::Tripod,
            "bump of the tripod, pixels (a cell is 8 wide)",
            vec![0.05, 0.1, 0.2, 0.3, 0.5, 1.0, 3.0, 10.0],
        ),
        (
            CaptureFault::Swapped,
            "one exchanged pair, at this part of the session",
            vec![0.06, 0.15, 0.3, 0.6, 0.95],
        ),
        (
            CaptureFault::Dropped,
            "one file missing, at this part of the session",
            vec![0.06, 0.3, 0.6, 0.95],
        ),
        (
            CaptureFault::Skipped,
            "one photograph never taken, all others moved up, from this part on",
            vec![0.06, 0.15, 0.3, 0.6, 0.95],
        ),
        (
            CaptureFault::Clipped,
            "times the right exposure",
            vec![1.1, 1.2, 1.25, 1.3, 1.4, 1.6, 2.5],
        ),
        (
            CaptureFault::Vivid,
            "vivid mode: part of the light that a dark picture loses",
            vec![0.01, 0.02, 0.03, 0.05, 0.1, 0.15, 0.3],
        ),
        (
            CaptureFault::Flicker,
            "amplitude of bands of mains light",
            vec![0.002, 0.005, 0.01, 0.02, 0.03, 0.06, 0.15],
        ),
    ]
}

/// A table of what was noticed, a line for each fault.
pub fn table(sessions: &[(&'static str, Vec<GateSession>)]) -> String {
    let mut text = String::from(
        "| fault | passes in silence | remark from | refused from | by |\n|---|---|---|---|---|\n",
    );
    for (what, sessions) in sessions {
        let size = |session: &GateSession| session.fault.map_or(0.0, |fault| fault.size);
        let fails = |session: &&GateSession| !session.that(Verdict::Fail).is_empty();
        let remarks = |session: &&GateSession| !session.that(Verdict::Warn).is_empty();
        let silent: Vec<String> = (sessions.iter())
            .filter(|session| !fails(session) && !remarks(session))
            .map(|session| size(session).to_string())
            .collect();
        let first = |of: &dyn Fn(&&GateSession) -> bool| {
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
