//! `iltm status` and `iltm monitor` as a user meets them, with a device at the end of a
//! pseudo-terminal.

use super::user::{User, contains, interrupt};
use iltm_runtime::link::{Event, Fault, TierReason};
use iltm_tests::fake_device::{FakeDevice, FakePort, Order};
use serde_json::Value;
use std::io::{BufRead, BufReader};
use std::process::{Child, ChildStdout, Command};
use std::time::{Duration, Instant};

/// Exit code and what people read of a command to a port, whose name is taken out.
fn said(command: &str, port: &str) -> String {
    let ended = User::new().run(&format!("{command} --port {port}"));
    ended.with_code().replace(port, "PORT")
}

#[test]
fn status_says_how_a_device_is() {
    let mut device = FakeDevice::default();
    device.status.last_fault = Some(Fault::Watchdog);
    device.status.watchdog_resets = 1;
    let port = FakePort::new(device);
    let said = said("status", port.path());
    // Uptime and counts of frames follow the clock.
    let lines = said.lines().map(|line| match line.split_once(", up ") {
        Some((before, _)) => format!("{before}, up TIME\n"),
        None if line.starts_with("frames ") => {
            line.replace(|c: char| c.is_ascii_digit(), "") + "\n"
        }
        None => line.to_owned() + "\n",
    });
    insta::assert_snapshot!(lines.collect::<String>());
}

#[test]
fn status_in_json_is_one_object() {
    let port = FakePort::new(FakeDevice::default());
    let status = User::new().run(&format!("--json status --port {}", port.path()));
    assert_eq!((status.code, &*status.said), (0, ""));
    let data = status.json();
    assert_eq!(data["port"], port.path());
    assert_eq!(data["device"]["board"], "made-up");
    assert_eq!(data["mode"], "compensating");
    assert_eq!(data["tier"], 3);
    assert_eq!(data["table"]["id"], "89abcdef");
    assert_eq!(data["frame_time_us"]["budget"], 16_667);
    assert_eq!(data["slots"][0], "active");
    assert!(data["last_fault"].is_null());
}

#[test]
fn a_port_that_is_not_there_is_named() {
    for command in ["status", "monitor"] {
        insta::assert_snapshot!(
            "a_port_that_is_not_there_is_named",
            said(command, "/dev/no-such-port")
        );
    }
}

#[test]
fn a_port_where_nobody_answers_is_no_answer() {
    let (ours, theirs) = serialport::TTYPort::pair().expect("a pseudo-terminal");
    let port = serialport::SerialPort::name(&theirs).expect("it has a name");
    let start = Instant::now();
    let status = User::new().run(&format!("--json status --port {port}"));
    assert!(start.elapsed() < Duration::from_secs(20), "it gives up");
    assert_eq!(status.code, 11);
    let error = &status.json()["error"];
    assert_eq!(error["kind"], "no-answer");
    contains(&error["message"].to_string(), &["the line is silent"]);
    drop(ours);
}

#[test]
fn noise_around_an_answer_does_not_hide_it() {
    let port = FakePort::new(FakeDevice::default());
    port.order(Order::Noise(vec![0x55; 2_000]));
    User::new().says(&format!("status --port {}", port.path()));
}

#[test]
fn a_device_of_another_version_says_which_side_to_change() {
    let port = FakePort::new(FakeDevice {
        protocol: 3,
        ..FakeDevice::default()
    });
    insta::assert_snapshot!(said("status", port.path()));
}

#[test]
fn a_device_s_name_does_not_command_the_terminal() {
    // Sets the title of a terminal's window.
    let named = || {
        let mut device = FakeDevice::default();
        device.status.board = "\x1b]0;mine\x07".try_into().expect("a short name");
        device
    };
    let mut watching = Watching::of(named(), "monitor");
    let mut seen = watching.until("mine");
    watching.interrupted();
    let port = FakePort::new(named());
    seen += &said("status", port.path());
    let obeyed = |c: char| c.is_control() && c != '\n';
    assert!(!seen.contains(obeyed), "{seen:?}");
}

/// A monitor of a device, whose lines are read while it runs.
struct Watching {
    child: Child,
    lines: BufReader<ChildStdout>,
    port: FakePort,
    _user: User,
}

impl Watching {
    fn start(command: &str) -> Self {
        Self::of(FakeDevice::default(), command)
    }

    fn of(device: FakeDevice, command: &str) -> Self {
        let port = FakePort::new(device);
        let line = format!("{command} --period 100 --port {}", port.path());
        let user = User::new();
        let mut child = user.spawn(&line);
        Self {
            lines: BufReader::new(child.stdout.take().expect("piped")),
            child,
            port,
            _user: user,
        }
    }

    /// The next line that contains `words`; statuses go on for ever, so a monitor
    /// that never says them fails by its number of lines.
    fn until(&mut self, words: &str) -> String {
        for _ in 0..200 {
            let mut line = String::new();
            self.lines.read_line(&mut line).expect("readable");
            if line.contains(words) {
                return line;
            }
        }
        panic!("200 lines without {words}");
    }

    fn interrupted(self) {
        interrupt(&self.child);
        self.ends();
    }

    fn ends(mut self) {
        let ended = self.child.wait().expect("it ends");
        assert_eq!(ended.code(), Some(0), "ctrl-C is no failure");
    }
}

const CHANGED: Event = Event::TierChanged {
    from: 3,
    to: 2,
    reason: TierReason::OverBudget,
    frame: 77,
};

#[test]
fn monitor_prints_a_line_for_everything_that_happens() {
    let mut watching = Watching::start("monitor");
    let connected = watching.until("connected");
    assert_eq!(connected, "connected to made-up, firmware 1.2.300\n");
    watching.until("compensating, tier 3 of 5");
    // From the second status on there is a rate: the device counts 60 a second.
    let status = watching.until("compensating, tier 3 of 5");
    contains(
        &status,
        &["9.0 of 16.7 ms, clipped 1.00 % at black and 0.50 % at white, 1 late"],
    );
    watching.port.order(Order::Event(CHANGED));
    let changed = watching.until("tier 3 to 2");
    assert_eq!(
        changed,
        "tier 3 to 2 at frame 77: a frame took longer than the budget\n"
    );
    watching.port.order(Order::Log(vec![1, 2, 3]));
    watching.until("3 bytes of log");
    watching.interrupted();
}

#[test]
fn an_interrupt_that_is_sent_twice_is_one() {
    let mut watching = Watching::start("monitor");
    watching.until("compensating");
    // As `timeout` does: to the process, and at once to its group.
    let id = watching.child.id();
    let twice = format!("kill -INT {id}; sleep .01; kill -INT {id}");
    let sent = Command::new("sh").args(["-c", &twice]).status();
    assert!(sent.expect("every system has it").success());
    watching.ends();
}

#[test]
fn monitor_in_json_prints_an_object_a_line() {
    let mut watching = Watching::start("--json monitor");
    let parse = |line: String| serde_json::from_str::<Value>(&line).expect("an object a line");
    let connected = parse(watching.until(""));
    assert_eq!(connected["event"], "connected");
    let status = parse(watching.until("\"status\""));
    assert_eq!(status["tier"], 3);
    watching.port.order(Order::Event(CHANGED));
    let changed = parse(watching.until("\"tier\","));
    assert_eq!(changed["event"], "tier");
    watching
        .port
        .order(Order::Event(Event::Fault(Fault::Crash)));
    let fault = parse(watching.until("\"fault\""));
    assert_eq!(fault["message"], "the firmware crashed and started anew");
    watching.interrupted();
}

#[test]
fn monitor_goes_on_when_the_device_restarts() {
    let mut watching = Watching::start("monitor");
    watching.until("compensating");
    watching.port.order(Order::Restart);
    watching.until("the device has restarted\n");
    watching.until("connected");
    watching.until("compensating");
    watching.interrupted();
}

#[test]
fn monitor_says_that_the_port_has_gone_and_tries_again() {
    let mut watching = Watching::start("monitor");
    watching.until("compensating");
    watching.port.order(Order::Vanish);
    let lost = watching.until("lost");
    contains(&lost, &["trying again"]);
    watching.interrupted();
}
