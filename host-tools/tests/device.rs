//! `status` and `monitor` as a user meets them, with a device at the end of a
//! pseudo-terminal.

#![cfg(unix)]

use iltm_runtime::link::{Event, Fault, TierReason};
use iltm_tests::fake_device::{FakeDevice, FakePort, Order};
use serde_json::Value;
use std::io::{BufRead, BufReader};
use std::process::{Child, ChildStdout, Command, Output, Stdio};
use std::time::{Duration, Instant};

fn iltm(arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_iltm"));
    command.args(arguments).stdin(Stdio::null());
    // Not the settings of whoever runs the tests.
    command.env("ILTM_CONFIG_DIR", "/no/such/folder");
    command.env("ILTM_STATE_DIR", "/no/such/folder");
    command
}

fn run(arguments: &[&str]) -> Output {
    iltm(arguments).output().expect("the binary is there")
}

/// Exit code and what people read, the port's name taken out.
fn said(output: &Output, port: &str) -> String {
    let code = output.status.code().expect("not killed");
    let text = String::from_utf8_lossy(&output.stderr).replace(port, "PORT");
    format!("exit {code}\n{text}")
}

#[test]
fn status_says_how_a_device_is() {
    let mut device = FakeDevice::default();
    device.status.last_fault = Some(Fault::Watchdog);
    device.status.watchdog_resets = 1;
    let port = FakePort::new(device);
    let output = run(&["status", "--port", port.path()]);
    assert!(output.stdout.is_empty());
    let said = said(&output, port.path());
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
    let output = run(&["--json", "status", "--port", port.path()]);
    assert!(output.status.success(), "{}", said(&output, port.path()));
    assert!(output.stderr.is_empty());
    let data: Value = serde_json::from_slice(&output.stdout).expect("one object");
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
        let output = run(&[command, "--port", "/dev/no-such-port"]);
        insta::assert_snapshot!(
            "a_port_that_is_not_there_is_named",
            said(&output, "/dev/no-such-port")
        );
    }
}

#[test]
fn a_port_where_nobody_answers_is_no_answer() {
    let (ours, theirs) = serialport::TTYPort::pair().expect("a pseudo-terminal");
    let port = serialport::SerialPort::name(&theirs).expect("it has a name");
    let start = Instant::now();
    let output = run(&["--json", "status", "--port", &port]);
    assert!(start.elapsed() < Duration::from_secs(20), "it gives up");
    assert_eq!(output.status.code(), Some(11));
    let data: Value = serde_json::from_slice(&output.stdout).expect("one object");
    assert_eq!(data["error"]["kind"], "no-answer");
    let message = data["error"]["message"].as_str().expect("words");
    assert!(message.contains("the line is silent"), "{message}");
    drop(ours);
}

#[test]
fn noise_around_an_answer_does_not_hide_it() {
    let port = FakePort::new(FakeDevice::default());
    port.order(Order::Noise(vec![0x55; 2_000]));
    let output = run(&["status", "--port", port.path()]);
    assert!(output.status.success(), "{}", said(&output, port.path()));
}

#[test]
fn a_device_of_another_version_says_which_side_to_change() {
    let port = FakePort::new(FakeDevice {
        protocol: 2,
        ..FakeDevice::default()
    });
    let output = run(&["status", "--port", port.path()]);
    insta::assert_snapshot!(said(&output, port.path()));
}

/// A monitor whose lines are read while it runs.
struct Watching {
    child: Child,
    lines: BufReader<ChildStdout>,
}

impl Watching {
    fn start(arguments: &[&str]) -> Self {
        let mut command = iltm(arguments);
        let mut child = command
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .expect("the binary is there");
        let lines = BufReader::new(child.stdout.take().expect("piped"));
        Self { child, lines }
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

    /// What ctrl-C does.
    fn interrupt(mut self) -> Option<i32> {
        let id = self.child.id().to_string();
        let sent = Command::new("kill").args(["-INT", &id]).status();
        assert!(sent.expect("every system has it").success());
        self.child.wait().expect("it ends").code()
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
    let port = FakePort::new(FakeDevice::default());
    let mut watching = Watching::start(&["monitor", "--port", port.path(), "--period", "100"]);
    let connected = watching.until("connected");
    assert_eq!(connected, "connected to made-up, firmware 1.2.300\n");
    watching.until("compensating, tier 3 of 5");
    // From the second status on there is a rate: the device counts 60 a second.
    let status = watching.until("compensating, tier 3 of 5");
    assert!(
        status.contains("9.0 of 16.7 ms, 1.00 % clipped, 1 late"),
        "{status}"
    );
    port.order(Order::Event(CHANGED));
    let changed = watching.until("tier 3 to 2");
    assert_eq!(
        changed,
        "tier 3 to 2 at frame 77: a frame took longer than the budget\n"
    );
    port.order(Order::Log(vec![1, 2, 3]));
    watching.until("3 bytes of log");
    assert_eq!(watching.interrupt(), Some(0), "ctrl-C is no failure");
}

#[test]
fn monitor_in_json_prints_an_object_a_line() {
    let port = FakePort::new(FakeDevice::default());
    let mut watching = Watching::start(&[
        "--json",
        "monitor",
        "--port",
        port.path(),
        "--period",
        "100",
    ]);
    let parse = |line: String| serde_json::from_str::<Value>(&line).expect("an object a line");
    let connected = parse(watching.until(""));
    assert_eq!(connected["event"], "connected");
    let status = parse(watching.until("\"status\""));
    assert_eq!(status["tier"], 3);
    port.order(Order::Event(CHANGED));
    let changed = parse(watching.until("\"tier\","));
    assert_eq!(changed["event"], "tier");
    port.order(Order::Event(Event::Fault(Fault::Crash)));
    let fault = parse(watching.until("\"fault\""));
    assert_eq!(fault["message"], "the firmware crashed and started anew");
    assert_eq!(watching.interrupt(), Some(0));
}

#[test]
fn monitor_goes_on_when_the_device_restarts() {
    let port = FakePort::new(FakeDevice::default());
    let mut watching = Watching::start(&["monitor", "--port", port.path(), "--period", "100"]);
    watching.until("compensating");
    port.order(Order::Restart);
    watching.until("the device has restarted\n");
    watching.until("connected");
    watching.until("compensating");
    assert_eq!(watching.interrupt(), Some(0));
}

#[test]
fn monitor_says_that_the_port_has_gone_and_tries_again() {
    let port = FakePort::new(FakeDevice::default());
    let mut watching = Watching::start(&["monitor", "--port", port.path(), "--period", "100"]);
    watching.until("compensating");
    port.order(Order::Vanish);
    let lost = watching.until("lost");
    assert!(lost.contains("trying again"), "{lost}");
    assert_eq!(watching.interrupt(), Some(0));
}
