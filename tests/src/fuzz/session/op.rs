//! Session operations: what happens to a device, decoded from any bytes.

use crate::flash_simulator::Wear;
use crate::fuzz::files::{DEVICES, GOOD, files, keys};

/// Bytes of an operation; what a mutation moves as one.
pub(in crate::fuzz) const OP: usize = 4;

/// Most operations of one execution.
pub(super) const MAX_OPS: usize = 64;

/// Something that happens.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) enum Op {
    Hello,
    Status,
    Slots,
    Subscribe {
        period_ms: u16,
    },
    Sectors {
        length: u32,
        first: u32,
    },
    Begin {
        file: usize,
        /// Added to its length.
        more: i32,
        proof: Proof,
    },
    Write {
        file: usize,
        chunk: usize,
        twist: Twist,
    },
    /// All that a host does to have a file in use on trial, but for sectors that the
    /// device has already, if it is `sparing`.
    Send {
        file: usize,
        sparing: bool,
    },
    Activate {
        file: usize,
        trial_s: u16,
    },
    Confirm {
        table: Which,
        proof: Proof,
    },
    Rollback {
        table: Which,
        proof: Proof,
    },
    Provision {
        key: [u8; 32],
        device: u64,
        even_so: bool,
    },
    /// The last request once more, under the same number.
    Again,
    /// The following requests come together, so many at once.
    Together {
        count: usize,
    },
    /// A request whose payload is not as it should be.
    Odd {
        request: u8,
        how: u8,
    },
    /// Bytes that are no frame, with or without an end.
    Garbage {
        seed: u8,
        length: u8,
        end: bool,
    },
    /// A good frame of a channel that is not the host's.
    OtherChannel {
        channel: u8,
    },
    Wait {
        ms: u64,
    },
    Restart,
    /// The power fails within this many steps of the flash.
    Cut {
        steps: u64,
    },
    /// Bits of a slot flip while the device is off.
    Rot {
        slot: usize,
        at: u16,
        bits: usize,
    },
    /// Bits of the records flip while the device is off.
    RotRecords {
        bits: usize,
    },
    /// A sector of the records, or that of the key, stands no further erase.
    Wear {
        /// Counted from the first of the records.
        sector: usize,
        how: Wear,
    },
    /// A file is put into a slot through the debug port, as in a factory.
    Put {
        slot: usize,
        file: usize,
    },
}

/// What is wrong with a chunk.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) enum Twist {
    None,
    Offset,
    Short,
    Long,
    Bytes,
    Transfer,
}

/// What a request shows of a right.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) enum Proof {
    /// Signed by the device's owner.
    Owner,
    /// Signed by a technician with this device's number, or another, and of this version.
    Technician { device: u64, version: u32 },
    /// Signed by somebody else, who certifies himself or not.
    Stranger { certified: bool },
    /// Signed for another record.
    Stale,
    /// None, or half of one.
    None { length: usize },
}

impl Proof {
    const fn of(number: u8) -> Self {
        match number % 16 {
            0 => Self::None { length: 0 },
            1 => Self::None { length: 63 },
            2 => Self::Stale,
            3 => Self::Stranger { certified: false },
            4 => Self::Stranger { certified: true },
            5 | 6 => Self::Technician {
                device: 0,
                version: number as u32 / 16,
            },
            7 => Self::Technician {
                device: DEVICES[number as usize / 16 % 2],
                version: 9,
            },
            _ => Self::Owner,
        }
    }
}

/// The table that a request is about.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) enum Which {
    InUse,
    Other,
    Unknown,
}

impl Which {
    const fn of(number: u8) -> Self {
        match number % 8 {
            0 => Self::Other,
            1 => Self::Unknown,
            _ => Self::InUse,
        }
    }
}

impl Op {
    /// Any four bytes are an operation.
    pub(super) fn decode([kind, a, b, c]: [u8; OP]) -> Self {
        // Most files that are named are good ones.
        let file = match a % 4 {
            0 => usize::from(b) % files().len(),
            _ => usize::from(b) % GOOD,
        };
        match kind % 40 {
            0 => Self::Hello,
            1 => Self::Status,
            2 => Self::Slots,
            3 => Self::Subscribe {
                period_ms: u16::from(a % 4) * u16::from(b) * 8,
            },
            4 => Self::Sectors {
                length: u32::from(a) * 4 + u32::from(b % 4),
                first: if c < 250 { u32::from(c % 16) } else { u32::MAX },
            },
            5 | 6 => Self::Begin {
                file,
                more: match c {
                    0..8 => i32::from(c) - 4,
                    8 => i32::MAX,
                    9 => 600,
                    _ => 0,
                },
                proof: Proof::of(c),
            },
            7..=10 => Self::Write {
                file,
                chunk: usize::from(c % 16),
                twist: match c / 16 {
                    0 => Twist::Offset,
                    1 => Twist::Short,
                    2 => Twist::Long,
                    3 | 4 => Twist::Bytes,
                    5 => Twist::Transfer,
                    _ => Twist::None,
                },
            },
            11..=16 => Self::Send {
                file,
                sparing: c % 2 == 0,
            },
            17 | 18 => Self::Activate {
                file,
                trial_s: u16::from(c) * u16::from(c),
            },
            19..=22 => Self::Confirm {
                table: Which::of(a),
                proof: Proof::of(b),
            },
            23..=25 => Self::Rollback {
                table: Which::of(a),
                proof: Proof::of(b),
            },
            26 => Self::Provision {
                key: keys()[usize::from(a) % 3 * usize::from(c % 4 == 0)],
                device: DEVICES[usize::from(b % 8 == 0)],
                even_so: b % 4 != 1,
            },
            27 => Self::Again,
            28 => Self::Together {
                count: 2 + usize::from(a % 2),
            },
            29 => Self::Odd { request: a, how: b },
            30 => Self::Garbage {
                seed: a,
                length: b,
                end: c % 2 == 0,
            },
            31 => Self::OtherChannel { channel: a % 5 },
            32 => Self::Wait {
                ms: u64::from(a % 128) * u64::from(b),
            },
            33 => Self::Wait {
                ms: u64::from(c) * u64::from(c) * 1_000,
            },
            34 => Self::Restart,
            35 | 36 => Self::Cut {
                steps: u64::from(a) * u64::from(b % 8) + u64::from(c % 64),
            },
            37 => Self::Rot {
                slot: usize::from(a % 2),
                at: u16::from_le_bytes([b, c]),
                bits: usize::from(a / 64),
            },
            38 => match a % 8 {
                0 => Self::RotRecords {
                    bits: usize::from(b % 4),
                },
                1 | 2 => Self::Wear {
                    sector: usize::from(b % 3),
                    // A stuck bit is a unit that is not erased: a record over it counts as
                    // a broken rule in the simulator.
                    how: [Wear::LostBits, Wear::Refuses][usize::from(c % 2)],
                },
                _ => Self::Restart,
            },
            _ => Self::Put {
                slot: usize::from(c % 2),
                file,
            },
        }
    }
}
