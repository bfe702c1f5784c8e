//! Serial link: host and device at the two ends of one line, good and bad.

use iltm::device::port::BAUD;
use iltm::device::transcript::Transcribed;
use iltm::device::{Client, DeviceError, Incoming, Patience, Port};
use iltm_runtime::link::{Channel, Decoder, Event, PROTOCOL_VERSION, Request, SlotState};
use iltm_tests::fake_device::{FakeDevice, FakeLine, FakePort, FakeTables};
use iltm_tests::fuzz;
use iltm_tests::line_faults::{FaultRates, Faults, LossyLine, LossyProxy};
use std::io::{self, Write};
use std::sync::{Arc, Mutex};
use std::time::Duration;

/// Time on a line in memory costs nothing.
const PATIENT: Patience = Patience {
    answer: Duration::from_millis(400),
    tries: 40,
};

fn client(rates: FaultRates, seed: u64) -> Client<LossyLine<FakeLine>> {
    let line = FakeDevice::default().line(BAUD);
    let line = LossyLine::new(line, Faults::both_ways(rates, seed));
    Client::greet(line, PATIENT).expect("40 tries are enough")
}

#[test]
fn a_host_learns_who_the_device_is_and_how_it_is() {
    let mut client = client(FaultRates::default(), 1);
    assert_eq!(client.device(), &FakeDevice::default().identity());
    let status = client.status().expect("an answer");
    assert_eq!(status.tier, 3);
    assert_eq!(status.slots, [SlotState::Active, SlotState::Empty]);
    assert_eq!(status.serial.bad, 0);
}

#[test]
fn a_line_that_damages_a_fifth_of_all_frames_carries_every_request() {
    for seed in 0..50 {
        let mut client = client(FaultRates::evenly(200), seed);
        for _ in 0..20 {
            let status = client.status().expect("40 tries are enough");
            assert_eq!((status.tier, status.top_tier), (3, 5), "seed {seed}");
        }
    }
}

#[test]
fn a_line_that_is_unplugged_is_gone_and_serves_the_next_client_when_it_is_back() {
    let faults = Faults::both_ways(FaultRates::default(), 1).unplugged_after(6);
    let mut line = LossyLine::new(FakeDevice::default().line(BAUD), faults);
    let mut client = Client::greet(&mut line, PATIENT).expect("two frames");
    for _ in 0..2 {
        client.status().expect("two frames");
    }
    let gone = client.status().expect_err("unplugged");
    assert!(matches!(gone, DeviceError::Gone { .. }), "{gone:?}");
    line.plug_in();
    let mut client = Client::greet(&mut line, PATIENT).expect("back");
    client.status().expect("back");
}

#[test]
fn a_proxy_damages_frames_between_a_port_and_any_client() {
    let device = FakePort::new(FakeDevice::default());
    let faults = Faults::both_ways(FaultRates::evenly(200), 1);
    let proxy = LossyProxy::start(device.path(), BAUD, faults).expect("a port");
    for _ in 0..2 {
        let patience = Patience {
            answer: Duration::from_millis(60),
            tries: 40,
        };
        let port = Port::open(proxy.path(), BAUD).expect("a pseudo-terminal");
        let mut client = Client::greet(port, patience).expect("40 tries are enough");
        for _ in 0..15 {
            client.status().expect("40 tries are enough");
        }
    }
    let (there, back) = (proxy.to_device(), proxy.to_host());
    assert!(
        there.frames >= 32 && back.frames >= 20,
        "{there:?} {back:?}"
    );
    assert!(
        there.faulty() > 0 && back.faulty() > 0,
        "{there:?} {back:?}"
    );
}

#[test]
fn a_proxy_that_is_unplugged_takes_its_port_with_it() {
    let device = FakePort::new(FakeDevice::default());
    let faults = Faults::both_ways(FaultRates::default(), 1).unplugged_after(4);
    let proxy = LossyProxy::start(device.path(), BAUD, faults).expect("a port");
    let port = Port::open(proxy.path(), BAUD).expect("a pseudo-terminal");
    let mut client = Client::greet(port, Patience::default()).expect("two frames");
    client.status().expect("two frames");
    let gone = client.status().expect_err("unplugged");
    assert!(matches!(gone, DeviceError::Gone { .. }), "{gone:?}");
    assert!(Port::open(proxy.path(), BAUD).is_err(), "no such port");
    assert_eq!((proxy.to_device().frames, proxy.to_host().frames), (2, 2));
    // The real port is free again.
    let port = Port::open(device.path(), BAUD).expect("free");
    Client::greet(port, Patience::default()).expect("a device");
}

#[test]
fn events_that_are_lost_on_the_way_are_missed() {
    let rates = FaultRates::only(|rates| rates.drop = 300);
    let mut client = client(rates, 3);
    let granted = client.subscribe(Duration::from_millis(100));
    assert_eq!(granted.expect("an answer").period.as_millis(), 100);
    let (mut came, mut missed) = (0, 0);
    for _ in 0..40 {
        match client.next(Duration::from_millis(100)).expect("a line") {
            Some(Incoming::Event(Event::Status(status))) => {
                assert_eq!(status.tier, 3);
                came += 1;
            }
            Some(Incoming::Missed { channel, count }) => {
                assert_eq!(channel, Channel::Event);
                missed += u32::from(count);
            }
            None => {}
            other => panic!("{other:?}"),
        }
    }
    assert!(came >= 10 && missed >= 3, "{came} came, {missed} missed");
}

/// Sends what a device at another speed would look like.
#[derive(Debug)]
struct Nonsense;
impl iltm::device::Line for Nonsense {
    fn read(&mut self, bytes: &mut [u8], _wait: Duration) -> std::io::Result<usize> {
        bytes.fill_with(|| fastrand::u8(..));
        Ok(bytes.len())
    }
    fn write(&mut self, _bytes: &[u8]) -> std::io::Result<()> {
        Ok(())
    }
}

#[test]
fn a_silent_line_is_told_from_one_that_talks_nonsense() {
    let patience = Patience {
        answer: Duration::from_millis(5),
        tries: 3,
    };
    let all = Faults::both_ways(FaultRates::silence(), 1);
    let line = LossyLine::new(FakeDevice::default().line(BAUD), all);
    let silent = Client::greet(line, patience).expect_err("nothing comes through");
    assert!(silent.to_string().contains("silent"), "{silent}");

    let nonsense = Client::greet(Nonsense, patience).expect_err("no device");
    assert!(matches!(
        nonsense,
        DeviceError::NoAnswer { heard, .. } if heard.bytes > 0 && heard.frames == 0
    ));
    assert!(silent.next_step().contains("power"));
    assert!(nonsense.next_step().contains("something else speaks there"));
}

#[test]
fn a_device_of_another_version_is_recognised() {
    let device = FakeDevice {
        protocol: 99,
        ..FakeDevice::default()
    };
    let error = Client::greet(device.line(BAUD), PATIENT).expect_err("another version");
    assert!(matches!(error, DeviceError::Protocol { device: 99 }));
}

#[test]
fn whose_version_is_behind_is_said() {
    let step = |device| DeviceError::Protocol { device }.next_step();
    let (older, newer) = (PROTOCOL_VERSION - 1, PROTOCOL_VERSION + 1);
    assert!(step(older).contains("firmware up to date"), "{older}");
    assert!(step(newer).contains("host tools"), "{newer}");
}

#[test]
fn another_device_at_the_same_port_is_not_taken_for_the_one_before() {
    let exchange = |other: fn(&mut FakeDevice)| {
        let line = FakeDevice::default().line(BAUD);
        let mut client = Client::greet(line, PATIENT).expect("it is there");
        client.line().far_end_mut().restart();
        client.greet_again().expect("the same device");
        client.line().far_end_mut().restart();
        other(&mut client.line().far_end_mut().device);
        let error = client.greet_again().expect_err("another device");
        assert!(matches!(error, DeviceError::Exchanged), "{error:?}");
    };
    exchange(|device| device.number += 1);
    exchange(|device| device.status.board = "another".parse().expect("short"));
}

/// Where a transcript goes.
#[derive(Clone, Default)]
struct Shared(Arc<Mutex<Vec<u8>>>);

impl Write for Shared {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.0.lock().expect("nobody panics").write(bytes)
    }
    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

#[test]
fn a_transcript_says_when_what_was_said_and_no_whole_key() {
    let device = FakeDevice {
        tables: Some(FakeTables::default()),
        ..FakeDevice::default()
    };
    let shared = Shared::default();
    let mut line = Transcribed::new(device.line(9_600));
    line.write_to(Box::new(shared.clone()));
    let mut client = Client::greet(line, PATIENT).expect("it is there");
    client.provision([0xAB; 32], 9, true).expect("it has none");
    client.status().expect("an answer");
    client.line().remark("the end");
    let bytes = shared.0.lock().expect("nobody panics").clone();
    let text = String::from_utf8(bytes).expect("text");
    let times: Vec<f64> = (text.lines())
        .map(|line| line[..10].trim().parse().expect("seconds"))
        .collect();
    assert!(times.is_sorted(), "{text}");
    // A hello, a key, a status and what answers them: more than 100 bytes at 960 a second.
    assert!(*times.last().expect("lines") > 0.1, "{text}");
    assert!(text.contains(&"ab".repeat(4)), "{text}");
    assert!(!text.contains(&"ab".repeat(32)), "{text}");
    assert!(text.ends_with("- the end\n"), "{text}");
}

#[test]
fn the_fuzz_target_says_what_it_thinks_it_says() {
    let mut decoder = Decoder::new();
    let mut requests = Vec::new();
    for byte in [&fuzz::HELLO[..], &fuzz::SUBSCRIBE].concat() {
        if let Some(frame) = decoder.push(byte) {
            let frame = frame.expect("whole");
            requests.push((frame.sequence, frame.payload.to_vec()));
        }
    }
    let expected = [
        (
            7,
            Ok(Request::Hello {
                protocol: PROTOCOL_VERSION,
            }),
        ),
        (8, Ok(Request::Subscribe { period_ms: 500 })),
    ];
    let requests = requests.iter();
    let requests: Vec<_> = requests
        .map(|(sequence, payload)| (*sequence, Request::parse(payload)))
        .collect();
    assert_eq!(requests, expected);
}
