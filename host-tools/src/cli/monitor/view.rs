//! View of a monitored device, as lines of a given width.

use super::super::output::printable;
use super::super::words;
use super::event::MonitorEvent;
use chrono::Local;
use console::{StyledObject, style, truncate_str};
use iltm_runtime::link::{Event, Hello, Mode, Slots, Status};
use std::collections::VecDeque;
use std::time::Instant;

/// Events and log lines that are kept: more than any terminal has rows.
const KEPT: usize = 200;

/// Width of a bar in cells.
const BAR: usize = 30;

/// Shares of the budget from which a bar is yellow, then red.
const WARM: f64 = 0.7;
const HOT: f64 = 0.9;

/// Frames a second, from what a device counts.
#[derive(Debug, Default)]
pub(in super::super) struct Rates {
    /// Uptime in ms, received, shown.
    last: Option<(u64, u32, u32)>,
    a_second: Option<(f64, f64)>,
}

impl Rates {
    /// Takes the next status.
    pub(super) fn add(&mut self, status: &Status) {
        let frames = &status.frames;
        let now = (status.uptime_ms, frames.received, frames.shown);
        if let Some((time, received, shown)) = self.last
            && now.0 > time
        {
            let seconds = (now.0 - time) as f64 / 1000.0;
            let rate = |new: u32, old: u32| f64::from(new.saturating_sub(old)) / seconds;
            self.a_second = Some((rate(now.1, received), rate(now.2, shown)));
        }
        self.last = Some(now);
    }

    /// In words; there is no rate before the second status.
    pub(super) fn words(&self) -> String {
        match self.a_second {
            Some((received, shown)) => format!("{received:.1} in/s, {shown:.1} out/s"),
            None => "- in/s, - out/s".to_owned(),
        }
    }
}

/// What is known of the device.
#[derive(Debug)]
pub(super) struct View {
    port: String,
    device: Option<Hello>,
    status: Option<Status>,
    /// And when the device said so.
    slots: Option<(Slots, Instant)>,
    rates: Rates,
    lost: Option<String>,
    events: VecDeque<String>,
    log: VecDeque<String>,
}

impl View {
    pub(super) fn new(port: &str) -> Self {
        Self {
            port: port.to_owned(),
            device: None,
            status: None,
            slots: None,
            rates: Rates::default(),
            lost: None,
            events: VecDeque::new(),
            log: VecDeque::new(),
        }
    }

    /// Takes in what has happened.
    pub(super) fn take(&mut self, event: &MonitorEvent) {
        match event {
            MonitorEvent::Device(Event::Status(status)) => {
                self.rates.add(status);
                self.status = Some(status.clone());
            }
            MonitorEvent::Slots(slots) => {
                self.slots = Some(((**slots).clone(), Instant::now()));
            }
            MonitorEvent::Connected(device) => {
                self.device = Some(device.clone());
                self.rates = Rates::default();
                self.lost = None;
                self.event(event);
            }
            MonitorEvent::Lost(why) => {
                self.lost = Some(printable(why).into_owned());
                self.event(event);
            }
            MonitorEvent::Log(message) => {
                let level = match message.level.as_str() {
                    "error" => style("error").red(),
                    "warn" => style("warn ").yellow(),
                    "info" => style("info ").green(),
                    "debug" => style("debug").blue(),
                    "trace" => style("trace").dim(),
                    _ => style("     "),
                };
                let (time, text) = (printable(&message.time), printable(&message.text));
                let line = format!("{time} {level} {text}");
                keep(&mut self.log, line);
            }
            MonitorEvent::UnreadLog { .. } => {
                self.log.clear();
                self.log.extend(event.words());
            }
            MonitorEvent::Device(_) | MonitorEvent::Missed { .. } | MonitorEvent::Restarted => {
                self.event(event);
            }
        }
    }

    fn event(&mut self, event: &MonitorEvent) {
        let time = Local::now().format("%H:%M:%S").to_string();
        let words = event.words().unwrap_or_default();
        let words = style(printable(&words));
        let words = match event {
            MonitorEvent::Device(Event::Fault(_)) | MonitorEvent::Lost(_) => words.red(),
            MonitorEvent::Missed { .. } | MonitorEvent::Restarted => words.yellow(),
            _ => words,
        };
        keep(&mut self.events, format!("{time}  {words}"));
    }

    /// What to leave on the terminal at the end.
    pub(super) fn last_words(&self) -> Vec<String> {
        let mut lines: Vec<String> = self.events.iter().rev().take(10).cloned().collect();
        lines.reverse();
        lines
    }

    /// The whole view, at most `height` lines of at most `width` columns.
    pub(super) fn lines(&self, width: usize, height: usize) -> Vec<String> {
        let mut lines = vec![self.title(), self.state(), String::new()];
        if let Some(status) = &self.status {
            lines.extend(self.figures(status));
            lines.push(String::new());
        }
        let rest = height.saturating_sub(lines.len());
        // Headings included; what the log does not need goes to the events.
        let for_log = match self.log.len() {
            0 => 0,
            lines => (lines + 1).min(rest / 2),
        };
        list(&mut lines, "events", &self.events, rest - for_log);
        list(&mut lines, "log", &self.log, for_log);
        lines.truncate(height);
        let cut = |line: &String| truncate_str(line, width, "…").into_owned();
        lines.iter().map(cut).collect()
    }

    fn title(&self) -> String {
        let name = style("iltm monitor").bold();
        match &self.device {
            Some(device) => format!(
                "{name}  {}  {}  firmware {}   {}",
                self.port,
                printable(&device.board),
                device.firmware,
                style("ctrl-C ends").dim()
            ),
            None => format!("{name}  {}", self.port),
        }
    }

    fn state(&self) -> String {
        if let Some(why) = &self.lost {
            return style(format!("lost: {why}; trying again"))
                .red()
                .to_string();
        }
        let Some(status) = &self.status else {
            return style("waiting for the first status").dim().to_string();
        };
        let slots = self.slots.as_ref().map(|(slots, _)| slots);
        let mode = style(words::mode(status, slots));
        let mode = match status.mode {
            Mode::Compensating => mode.green(),
            Mode::Alone => mode.yellow(),
            Mode::PassThrough(_) => mode.red(),
        };
        let trial = match self.trial_s() {
            0 => String::new(),
            left => format!(", {}", style(format!("{left} s of trial left")).yellow()),
        };
        format!("{mode}{trial}, up {}", words::duration(status.uptime_ms))
    }

    /// Seconds that the table in use is on trial yet.
    fn trial_s(&self) -> u64 {
        let left = self.slots.as_ref().map_or(0, |(slots, asked)| {
            let since = u64::try_from(asked.elapsed().as_millis()).unwrap_or(u64::MAX);
            u64::from(slots.trial_ms).saturating_sub(since)
        });
        left.div_ceil(1_000)
    }

    fn figures(&self, status: &Status) -> Vec<String> {
        let frames = &status.frames;
        let time = &status.frame_time;
        let share = |us: u32| f64::from(us) / f64::from(time.budget_us.max(1));
        let [black, white] = words::clipped_percent(status);
        let stack = f64::from(status.stack.used) / f64::from(status.stack.size.max(1));
        let line = |name: &str, value: String| format!("{name:<11}{value}");
        vec![
            line(
                "frames",
                format!(
                    "{}   {}   {}   {}",
                    self.rates.words(),
                    fault_count(frames.late, "late"),
                    fault_count(frames.dropped, "dropped"),
                    fault_count(frames.broken, "broken")
                ),
            ),
            line(
                "budget",
                format!(
                    "{} {:>6.1} % of {}",
                    gauge(share(time.mean_us), Some(share(time.worst_us))),
                    100.0 * share(time.mean_us),
                    words::milliseconds(time.budget_us)
                ),
            ),
            line(
                "",
                style(format!(
                    "last {}, mean {}, worst {}",
                    words::milliseconds(time.last_us),
                    words::milliseconds(time.mean_us),
                    words::milliseconds(time.worst_us)
                ))
                .dim()
                .to_string(),
            ),
            line("tier", ladder(status.tier, status.top_tier)),
            line(
                "clipped",
                format!(
                    "{} {black:>6.2} % at black, {white:.2} % at white",
                    gauge((black + white) / 100.0, None)
                ),
            ),
            line(
                "stack",
                format!(
                    "{} {:>6.1} % of {} bytes",
                    gauge(stack, None),
                    100.0 * stack,
                    status.stack.size
                ),
            ),
            line(
                "table",
                format!(
                    "{}   slots {}",
                    words::table_in_use(status, self.slots.as_ref().map(|(slots, _)| slots)),
                    words::slot_states(status)
                ),
            ),
            line(
                "line",
                format!(
                    "{}; watchdog {}",
                    words::serial(status),
                    words::watchdog(status)
                ),
            ),
        ]
    }
}

/// Dim while there are none.
fn fault_count(count: u32, what: &str) -> StyledObject<String> {
    let text = style(format!("{count} {what}"));
    if count == 0 {
        text.dim()
    } else {
        text.yellow()
    }
}

fn keep(lines: &mut VecDeque<String>, line: String) {
    if lines.len() == KEPT {
        lines.pop_front();
    }
    lines.push_back(line);
}

/// A heading and the newest lines below it, `rows` in all.
fn list(lines: &mut Vec<String>, heading: &str, items: &VecDeque<String>, rows: usize) {
    if rows < 2 {
        return;
    }
    lines.push(style(heading).bold().to_string());
    let first = items.len().saturating_sub(rows - 1);
    lines.extend(items.range(first..).map(|item| format!("  {item}")));
    let missing = (rows - 1).saturating_sub(items.len());
    lines.extend(std::iter::repeat_n(String::new(), missing));
}

/// A bar like a thermometer: each cell has the colour of the heat it stands for.
/// `peak` is marked where it was.
fn gauge(share: f64, peak: Option<f64>) -> String {
    const EIGHTHS: [&str; 8] = ["█", "▏", "▎", "▍", "▌", "▋", "▊", "▉"];
    let eighths = |share: f64| (share.clamp(0.0, 1.0) * (8 * BAR) as f64).ceil() as usize;
    let filled = eighths(share);
    let peak = peak.map(|peak| eighths(peak).div_ceil(8));
    let cell = |index: usize| {
        let heat = (index as f64 + 0.5) / BAR as f64;
        if 8 * (index + 1) <= filled {
            coloured(EIGHTHS[0], heat)
        } else if 8 * index < filled {
            coloured(EIGHTHS[filled % 8], heat)
        } else if peak == Some(index + 1) {
            coloured("│", heat)
        } else {
            style("·").dim()
        }
    };
    (0..BAR).map(|index| cell(index).to_string()).collect()
}

fn coloured(cell: &'static str, heat: f64) -> StyledObject<&'static str> {
    let cell = style(cell);
    if heat < WARM {
        cell.green()
    } else if heat < HOT {
        cell.yellow()
    } else {
        cell.red()
    }
}

/// The tiers as rungs, the one in use and those below it lit.
fn ladder(tier: u8, top: u8) -> String {
    let rung = |rung: u8| {
        if rung <= tier {
            style("■").cyan().to_string()
        } else {
            style("□").dim().to_string()
        }
    };
    let rungs: Vec<String> = (0..=top.min(31)).map(rung).collect();
    format!("{}  {tier} of {top}", rungs.join(" "))
}

#[cfg(test)]
mod tests {
    use super::*;
    use iltm_runtime::link::{
        Device, Fault, FaultyFrame, Mode, PassThrough, Request, Response, TierReason,
    };
    use iltm_tests::fake_device::{FakeDevice, FakeTables};

    /// The view without its times of day.
    fn shown(view: &View, width: usize, height: usize) -> String {
        console::set_colors_enabled(false);
        let lines = view.lines(width, height);
        assert!(lines.len() <= height);
        let wide = lines.iter().map(|line| console::measure_text_width(line));
        assert!(wide.max() <= Some(width));
        let time = |line: &String| {
            let is_time = |text: &str| {
                text.get(2..10)
                    .is_some_and(|at| at.matches(':').count() == 2)
            };
            if is_time(line) {
                format!("  hh:mm:ss{}", &line[10..])
            } else {
                line.clone()
            }
        };
        lines.iter().map(time).collect::<Vec<_>>().join("\n")
    }

    fn status(uptime_ms: u64) -> Status {
        let device = FakeDevice {
            uptime_ms,
            ..FakeDevice::default()
        };
        device.status()
    }

    #[test]
    fn the_view_shows_rates_tier_bars_events_and_log() {
        let mut view = View::new("/dev/ttyACM0");
        view.take(&MonitorEvent::Connected(FakeDevice::default().identity()));
        view.take(&MonitorEvent::Device(Event::Status(status(4_000))));
        view.take(&MonitorEvent::Device(Event::Status(status(5_000))));
        view.take(&MonitorEvent::Device(Event::TierChanged {
            from: 4,
            to: 3,
            reason: TierReason::OverBudget,
            frame: 250,
        }));
        view.take(&MonitorEvent::Device(Event::Fault(Fault::Frame {
            sequence: 260,
            cause: FaultyFrame::Torn,
        })));
        view.take(&MonitorEvent::UnreadLog { bytes: 12 });
        insta::assert_snapshot!(shown(&view, 80, 24));
    }

    #[test]
    fn a_small_terminal_cuts_the_view_and_breaks_nothing() {
        let mut view = View::new("/dev/ttyACM0");
        view.take(&MonitorEvent::Connected(FakeDevice::default().identity()));
        view.take(&MonitorEvent::Device(Event::Status(status(4_000))));
        for (width, height) in [(0, 0), (1, 1), (10, 3), (30, 12), (79, 15)] {
            shown(&view, width, height);
        }
    }

    #[test]
    fn what_is_left_of_a_trial_counts_down() {
        let mut view = View::new("/dev/ttyACM0");
        view.take(&MonitorEvent::Device(Event::Status(status(4_000))));
        let mut device = FakeDevice::with_tables(FakeTables::default());
        let Response::Slots(mut slots) = device.carry_out(Request::Slots, 0) else {
            panic!("not to a question for the slots");
        };
        slots.trial_ms = 77_000;
        view.take(&MonitorEvent::Slots(Box::new(slots.clone())));
        assert!(view.lines(80, 24)[1].contains(", 77 s of trial left, up"));
        slots.trial_ms = 0;
        view.take(&MonitorEvent::Slots(Box::new(slots)));
        assert!(!view.lines(80, 24)[1].contains("trial"));
    }

    #[test]
    fn a_lost_device_says_so_until_it_is_back() {
        let mut view = View::new("/dev/ttyACM0");
        let connected = MonitorEvent::Connected(FakeDevice::default().identity());
        view.take(&connected);
        view.take(&MonitorEvent::Device(Event::Status(status(4_000))));
        view.take(&MonitorEvent::Lost("the port has gone".to_owned()));
        assert!(view.lines(80, 24)[1].contains("lost: the port has gone"));
        view.take(&connected);
        assert!(view.lines(80, 24)[1].contains("compensating"));
    }

    #[test]
    fn bars_end_where_the_share_does() {
        console::set_colors_enabled(false);
        assert_eq!(gauge(0.0, None), "·".repeat(BAR));
        assert_eq!(gauge(1.0, None), "█".repeat(BAR));
        assert_eq!(gauge(7.0, Some(9.0)), "█".repeat(BAR), "over budget");
        assert_eq!(
            gauge(0.5, Some(1.0)),
            format!("{}{}│", "█".repeat(15), "·".repeat(14))
        );
        // 1 % of 30 cells is 2.4 eighths of one: what is there is seen.
        assert_eq!(gauge(0.01, None), format!("▍{}", "·".repeat(29)));
    }

    #[test]
    fn why_frames_pass_through_is_said() {
        let mut view = View::new("/dev/ttyACM0");
        let mut status = status(1_000);
        status.mode = Mode::PassThrough(PassThrough::NoTable);
        status.table = None;
        view.take(&MonitorEvent::Device(Event::Status(status)));
        assert!(
            view.lines(80, 24)[1]
                .contains("NOT COMPENSATING, frames pass unchanged: there is no table")
        );
    }
}
