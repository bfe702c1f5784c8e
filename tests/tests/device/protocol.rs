//! Protocol: that `docs/protocol.md` says what host and device say: its byte examples and
//! limits.

use ed25519_dalek::{Signer, SigningKey};
use iltm_runtime::image::Label;
use iltm_runtime::link::{
    Channel, Device as _, Digest, EndedTrial, Event, Fault, FaultyFrame, FrameKind, InUse,
    LinkFrame, MAX_ENCODED, MAX_PAYLOAD, MAX_SECTORS, PROTOCOL_VERSION, Receiving, Refusal,
    Request, Response, Sectors, SlotInfo, SlotState, Slots, TableAbout, TableName, TableReason,
    TierReason,
};
use iltm_runtime::store::MAX_CHUNK;
use iltm_runtime::trust::{Deed, Rejected};
use iltm_tests::fake_device::FakeDevice;
use serde::Serialize;
use std::collections::BTreeMap;
use std::fmt::Write as _;

/// The frames that the specification shows, by the name that it gives them: the
/// bytes before COBS, and on the line.
#[derive(Default)]
struct Examples(BTreeMap<&'static str, (Vec<u8>, Vec<u8>)>);

impl Examples {
    fn add(&mut self, name: &'static str, channel: Channel, sequence: u16, payload: &[u8]) {
        let mut line = [0; MAX_ENCODED];
        let frame = LinkFrame {
            channel,
            sequence,
            payload,
        };
        let length = frame.emit(&mut line).expect("short enough");
        let [low, high] = u16::to_le_bytes(sequence);
        let mut content = [&[channel as u8, low, high], payload].concat();
        let crc = iltm_runtime::image::crc32(&[&content]);
        content.extend(crc.to_le_bytes());
        self.0.insert(name, (content, line[..length].to_vec()));
    }

    fn message(
        &mut self,
        name: &'static str,
        channel: Channel,
        sequence: u16,
        message: &impl Serialize,
    ) {
        let mut bytes = [0; MAX_PAYLOAD];
        let payload = postcard::to_slice(message, &mut bytes).expect("short enough");
        self.add(name, channel, sequence, payload);
    }

    fn request(&mut self, name: &'static str, sequence: u16, request: &Request<'_>) {
        self.message(name, Channel::Request, sequence, request);
    }

    fn response(&mut self, name: &'static str, sequence: u16, response: &Response) {
        self.message(name, Channel::Response, sequence, response);
    }

    fn event(&mut self, name: &'static str, sequence: u16, event: &Event) {
        self.message(name, Channel::Event, sequence, event);
    }
}

/// The secret key of RFC 8032, section 7.1, test 1.
const SECRET: [u8; 32] = [
    0x9D, 0x61, 0xB1, 0x9D, 0xEF, 0xFD, 0x5A, 0x60, 0xBA, 0x84, 0x4A, 0xF4, 0x92, 0xEC, 0x2C, 0xC4,
    0x44, 0x49, 0xC5, 0x69, 0x7B, 0x32, 0x69, 0x19, 0x70, 0x3B, 0xAC, 0x03, 0x1C, 0xAE, 0x7F, 0x60,
];

/// What is said whatever the tables.
fn conversation(examples: &mut Examples) {
    let mut device = FakeDevice::default();
    let identity = device.identity();
    device.uptime_ms = 10_000;
    examples.request(
        "hello-request",
        1,
        &Request::Hello {
            protocol: PROTOCOL_VERSION,
        },
    );
    examples.response("hello-response", 1, &Response::Hello(identity));
    examples.request("status-request", 2, &Request::Status);
    examples.response("status-response", 2, &Response::Status(device.status()));
    let subscribe = Request::Subscribe { period_ms: 500 };
    examples.request("subscribe-request", 3, &subscribe);
    let subscribed = Response::Subscribed {
        period_ms: 500,
        lapse_ms: 5_000,
    };
    examples.response("subscribe-response", 3, &subscribed);
    let changed = Event::TierChanged {
        from: 3,
        to: 2,
        reason: TierReason::OverBudget,
        frame: 1_234,
    };
    examples.event("tier-event", 0, &changed);
    let fault = Event::Fault(Fault::Frame {
        sequence: 1_300,
        cause: FaultyFrame::Torn,
    });
    examples.event("fault-event", 1, &fault);
    examples.add("unknown-request", Channel::Request, 4, &[200]);
    let refused = Response::Refused(Refusal::Unknown);
    examples.response("unknown-response", 4, &refused);
    examples.add("log", Channel::Log, 0, &[0x07, 0x00, 0x8F, 0x4E]);
}

/// The older table in use, after a trial of the newer one.
fn slots(old: TableName, new: TableName) -> Slots {
    let slot = |state, table, length| SlotInfo {
        state,
        table,
        length,
        erases: 40,
        about: table.map(|_| TableAbout {
            label: Label::new("foyer", 20_261_123),
            frames: FrameKind {
                width: 16,
                height: 12,
                channels: 1,
            },
        }),
    };
    Slots {
        slots: [
            slot(SlotState::Active, Some(old), 4_800),
            slot(SlotState::Broken, None, 0),
        ],
        target: 1,
        trial_ms: 0,
        oldest: 7,
        key: Some([0xD7, 0x5A, 0x98, 0x01, 0x82, 0xB1, 0x0A, 0xB7]),
        device: 0x0102_0304_0506_0708,
        sector: 4_096,
        record_erases: 3,
        sequence: 12,
        ended: Some(EndedTrial {
            table: new.id,
            reason: TableReason::TrialOver,
            ago_ms: 2_000,
        }),
    }
}

/// A table of 5,000 bytes on its way, of which the first sector is there already.
fn update(examples: &mut Examples) {
    let old = TableName {
        id: 0x89AB_CDEF,
        version: 7,
    };
    let new = TableName {
        id: 0x0123_4567,
        version: 8,
    };
    let digest = Digest(*b"\x11\x22\x33\x44 the digest.");
    let transfer = digest.transfer();
    examples.request("slots-request", 5, &Request::Slots);
    let slots = slots(old, new);
    examples.response("slots-response", 5, &Response::Slots(slots));
    let (length, first) = (5_000, 0);
    examples.request("sectors-request", 6, &Request::Sectors { length, first });
    let crcs = [0x1020_3040, 0xFFFF_FFFF].into_iter().collect();
    let sectors = Response::Sectors(Sectors { first, crcs });
    examples.response("sectors-response", 6, &sectors);
    examples.request(
        "begin-request",
        7,
        &Request::Begin {
            length,
            digest,
            right: &[],
        },
    );
    let receiving = Response::Receiving(Receiving {
        slot: 1,
        chunk: 512,
        window: 3,
    });
    examples.response("begin-response", 7, &receiving);
    let bytes = b"the last chunk";
    let write = Request::Write {
        transfer,
        offset: 4_608,
        bytes,
    };
    examples.request("write-request", 8, &write);
    examples.response("write-response", 8, &Response::Written);
    let trial_s = 300;
    examples.request(
        "activate-request",
        9,
        &Request::Activate { transfer, trial_s },
    );
    let trial = Response::InUse(InUse {
        table: Some(new),
        trial_ms: 300_000,
    });
    examples.response("activate-response", 9, &trial);
    let event = Event::TableChanged {
        table: Some(new),
        reason: TableReason::Trial,
        frame: 2_000,
    };
    examples.event("table-event", 2, &event);
    examples.request(
        "confirm-request",
        10,
        &Request::Confirm {
            table: new.id,
            right: &[],
        },
    );
    let used = |table| {
        Response::InUse(InUse {
            table: Some(table),
            trial_ms: 0,
        })
    };
    examples.response("confirm-response", 10, &used(new));
    let signer = SigningKey::from_bytes(&SECRET);
    let deed = Deed::Rollback { table: new.id };
    let right = signer
        .sign(&deed.message(0x0102_0304_0506_0708, 12))
        .to_bytes();
    let back = Request::Rollback {
        table: new.id,
        right: &right,
    };
    examples.request("rollback-request", 11, &back);
    examples.response("rollback-response", 11, &used(old));
    owner(examples);
}

/// What a device asks of tables, and how it comes by a key.
fn owner(examples: &mut Examples) {
    let older = Rejected::Older {
        version: 6,
        floor: 7,
    };
    let refused = Response::Refused(Refusal::Table(older));
    examples.response("older-response", 12, &refused);
    let key = [
        0xD7, 0x5A, 0x98, 0x01, 0x82, 0xB1, 0x0A, 0xB7, 0xD5, 0x4B, 0xFE, 0xD3, 0xC9, 0x64, 0x07,
        0x3A, 0x0E, 0xE1, 0x72, 0xF3, 0xDA, 0xA6, 0x23, 0x25, 0xAF, 0x02, 0x1A, 0x68, 0xF7, 0x07,
        0x51, 0x1A,
    ];
    let device = 42;
    examples.request(
        "provision-request",
        13,
        &Request::Provision {
            key,
            device,
            even_so: false,
        },
    );
    examples.response("provision-response", 13, &Response::Provisioned);
}

fn examples() -> BTreeMap<&'static str, (Vec<u8>, Vec<u8>)> {
    let mut examples = Examples::default();
    conversation(&mut examples);
    update(&mut examples);
    examples.0
}

/// The bytes in the specification's blocks, by name; what follows a `|` explains.
fn written(kind: &str) -> BTreeMap<String, Vec<u8>> {
    const PROTOCOL: &str = include_str!("../../../docs/protocol.md");
    let mut blocks = BTreeMap::new();
    for block in PROTOCOL.split("```").skip(1).step_by(2) {
        let (name, lines) = block.split_once('\n').expect("a block has lines");
        let Some(name) = name.strip_prefix(kind) else {
            continue;
        };
        let bytes = lines.lines().flat_map(|line| {
            let bytes = line.split('|').next().unwrap_or_default();
            bytes.split_whitespace().map(|byte| {
                u8::from_str_radix(byte, 16).unwrap_or_else(|_| panic!("{name}: {byte}"))
            })
        });
        blocks.insert(name.trim().to_owned(), bytes.collect());
    }
    blocks
}

#[test]
fn the_specification_shows_the_bytes_that_are_sent() {
    let hex = |bytes: &[u8]| {
        let mut text = String::new();
        for byte in bytes {
            let _ = write!(text, "{byte:02x} ");
        }
        text
    };
    let (contents, lines) = (written("content "), written("line "));
    let mut differences = String::new();
    for (name, (content, line)) in examples() {
        if contents.get(name) != Some(&content) {
            let _ = writeln!(differences, "content {name}: {}", hex(&content));
        }
        if lines.get(name) != Some(&line) {
            let _ = writeln!(differences, "line {name}: {}", hex(&line));
        }
    }
    assert!(differences.is_empty(), "should be\n{differences}");
    assert_eq!(contents.len(), examples().len(), "none that nobody checks");
    assert_eq!(lines.len(), examples().len(), "none that nobody checks");
}

#[test]
fn the_specification_states_the_limits() {
    const PROTOCOL: &str = include_str!("../../../docs/protocol.md");
    for (name, value) in [
        ("Most bytes of a payload", MAX_PAYLOAD),
        ("Most bytes of a frame on the line", MAX_ENCODED),
        (
            "Shortest period of statuses, ms",
            iltm_runtime::link::MIN_PERIOD_MS.into(),
        ),
        (
            "Silence that ends a subscription, ms",
            iltm_runtime::link::LAPSE_MS.into(),
        ),
        ("Version of the protocol", PROTOCOL_VERSION.into()),
        ("Most bytes of a chunk", MAX_CHUNK),
        ("Most sectors in one response", MAX_SECTORS),
    ] {
        let row = format!("| {name} | {value} |");
        assert!(PROTOCOL.contains(&row), "{row}");
    }
}
