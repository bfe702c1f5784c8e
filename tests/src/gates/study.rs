//! Many sessions at once, each on a thread of its own, and what became of them.

use super::fault::{StudiedFault, named_by};
use super::session::{StudiedSession, failing};
use iltm::capture::{Gate, Verdict};
use std::fmt::Write;
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Instant;

/// How many sessions.
#[derive(Clone, Debug)]
pub struct Study {
    /// Seed of the first session; the others follow.
    pub first: u64,
    /// Good sessions.
    pub good: usize,
    /// Of these, the first so many are taken again with each fault.
    pub faulty: usize,
    /// The faults.
    pub faults: Vec<StudiedFault>,
    /// Sessions at the same time.
    pub threads: usize,
}

/// What became of the sessions.
#[derive(Clone, Default, Debug)]
pub struct StudyResult {
    /// Good sessions.
    pub good: usize,
    /// Good sessions that were refused, in words.
    pub refused: Vec<String>,
    /// Gates of good sessions.
    pub verdicts: Vec<GateCount>,
    /// For each fault.
    pub faults: Vec<FaultCount>,
}

/// What a gate said of good sessions.
#[derive(Clone, Default, Debug)]
pub struct GateCount {
    /// The gate.
    pub name: String,
    /// Sessions by verdict: pass, not judged, remark, fail.
    pub verdicts: [usize; 4],
    /// The largest number, of the limit.
    pub most: f64,
}

/// What became of sessions with a fault.
#[derive(Clone, Default, Debug)]
pub struct FaultCount {
    /// Sessions.
    pub all: usize,
    /// Found by the right gate.
    pub found: usize,
    /// The gate that finds it said that it could not judge.
    pub left_open: usize,
    /// Those that were not found, in words.
    pub missed: Vec<String>,
}

impl Study {
    /// Takes and judges all sessions; `say` is told of what went wrong as it comes.
    ///
    /// # Panics
    /// If a thread panicked.
    pub fn run(&self, say: &(dyn Fn(&str) + Sync)) -> StudyResult {
        let next = AtomicUsize::new(0);
        let result = Mutex::new(StudyResult {
            faults: vec![FaultCount::default(); self.faults.len()],
            ..StudyResult::default()
        });
        std::thread::scope(|threads| {
            for _ in 0..self.threads {
                threads.spawn(|| {
                    loop {
                        let at = next.fetch_add(1, Ordering::Relaxed);
                        if at >= self.good {
                            break;
                        }
                        self.one(at, &result, say);
                    }
                });
            }
        });
        let mut result = result.into_inner().expect("no thread panicked");
        // Threads end in any order.
        result.refused.sort();
        for count in &mut result.faults {
            count.missed.sort();
        }
        result
    }

    /// One session, good and with every fault.
    fn one(&self, at: usize, result: &Mutex<StudyResult>, say: &(dyn Fn(&str) + Sync)) {
        let start = Instant::now();
        let session = StudiedSession::new(self.first + at as u64);
        let simulation = session.simulation();
        let good = session.examined(&simulation, None);
        let good = good.unwrap_or_else(|error| panic!("{}: {error}", session.words));
        let seconds = start.elapsed().as_secs_f64();
        let mut said = String::new();
        {
            let mut result = result.lock().expect("no thread panicked");
            result.good += 1;
            count(&mut result.verdicts, &good.gates);
            for gate in good.gates.iter().filter(|gate| gate.limit > 0.0) {
                let _ = write!(said, "{} {:.2} ", gate.name, gate.number / gate.limit);
            }
            said += "of the limit\n";
            if let Some(words) = words(&session, "good", &failing(&good.gates)) {
                result.refused.push(words.clone());
                said += &words;
            }
        }
        let measured = good.measurements.is_some();
        for (k, fault) in self.faults.iter().enumerate() {
            if at >= self.faulty || !measured {
                break;
            }
            let made = session.fault(fault.kind, fault.size, &good);
            let (gates, found) = match session.examined(&simulation, Some(made)) {
                Ok(examined) => (examined.gates.clone(), fault.found(&examined.gates)),
                // Exchanged photographs of white and black are one alike.
                Err(error) => (Vec::new(), error.next_step().contains("exchanged")),
            };
            let mut result = result.lock().expect("no thread panicked");
            let entry = &mut result.faults[k];
            entry.all += 1;
            entry.found += usize::from(found);
            entry.left_open += usize::from(!found && fault.left_open(&gates));
            if !found {
                let not_passed: Vec<&Gate> = gates
                    .iter()
                    .filter(|g| g.verdict >= Verdict::Warn)
                    .collect();
                // Where nothing is said, what those said that ought to have spoken.
                let silent = || {
                    let ought = |gate: &&Gate| named_by(fault.kind).0.contains(&gate.name);
                    let ought: Vec<&Gate> = gates.iter().filter(ought).collect();
                    words(&session, &format!("{made} silent"), &ought)
                };
                let words = words(&session, &made.to_string(), &not_passed).or_else(silent);
                let words = words.unwrap_or_default();
                said += &words;
                entry.missed.push(words);
            }
        }
        let all = start.elapsed().as_secs_f64();
        say(&format!(
            "{:06} {seconds:.2} s, {all:.2} s\n{said}",
            session.seed
        ));
    }
}

/// What some gates say of a session; `None` without any.
fn words(session: &StudiedSession, what: &str, gates: &[&Gate]) -> Option<String> {
    let mut text = String::new();
    for gate in gates {
        let _ = writeln!(
            text,
            "{:06} {what}: {} {} {} {:.240} -> {:.60} | {}",
            session.seed,
            gate.verdict.name(),
            gate.name,
            gate.number_and_limit(),
            gate.what,
            gate.next_step,
            session.words
        );
    }
    (!text.is_empty()).then_some(text)
}

fn count(counts: &mut Vec<GateCount>, gates: &[Gate]) {
    for gate in gates {
        let name = gate.name.to_string();
        let at = counts.iter().position(|known| known.name == name);
        let at = at.unwrap_or_else(|| {
            counts.push(GateCount {
                name,
                ..GateCount::default()
            });
            counts.len() - 1
        });
        let count = &mut counts[at];
        count.verdicts[gate.verdict as usize] += 1;
        if gate.limit > 0.0 {
            count.most = count.most.max(gate.number / gate.limit);
        }
    }
}

impl StudyResult {
    /// The table of the gates' page.
    pub fn table(&self, study: &Study) -> String {
        let mut text = format!(
            "| sessions | how many | outcome |\n|---|---|---|\n| good | {} | {} refused |\n",
            self.good,
            self.refused.len()
        );
        for (fault, count) in study.faults.iter().zip(&self.faults) {
            let FaultCount {
                all,
                found,
                left_open,
                ..
            } = count;
            let judged = (all - left_open).max(1);
            let _ = writeln!(
                text,
                "| `{}`, {} {} | {all} | {found} found, {left_open} not judged ({:.1} % of those \
                 that are) |",
                fault.kind,
                fault.size,
                fault.words,
                100.0 * *found as f64 / judged as f64
            );
        }
        text += "\n| gate, of good sessions | passes | not judged | remark | fails | largest number, of \
                 the limit |\n|---|---|---|---|---|---|\n";
        for count in &self.verdicts {
            let [pass, not, warn, fail] = count.verdicts;
            let most = match count.most {
                0.0 => "-".to_owned(),
                most => format!("{:.0} %", 100.0 * most),
            };
            let _ = writeln!(
                text,
                "| `{}` | {pass} | {not} | {warn} | {fail} | {most} |",
                count.name
            );
        }
        text
    }
}
