//! Test device with every field at its longest.

use super::*;
use crate::units::ClippedSamples;

/// Says what takes most bytes.
pub(super) struct FullDevice;

const VERSION: Version = Version {
    major: u16::MAX,
    minor: u16::MAX,
    patch: u16::MAX,
};

const KIND: FrameKind = FrameKind {
    width: u16::MAX,
    height: u16::MAX,
    channels: u8::MAX,
};

fn name() -> Name {
    let name = [b'x'; MAX_NAME];
    let name = core::str::from_utf8(&name).expect("ASCII");
    Name::try_from(name).expect("the longest name")
}

pub(super) fn identity() -> Hello {
    Hello {
        protocol: u16::MAX,
        firmware: VERSION,
        board: name(),
        device: u64::MAX,
        table_format: u16::MAX,
        max_payload: u16::MAX,
        limits: Limits {
            cells: u32::MAX,
            frame_bytes: u32::MAX,
            table_bytes: u32::MAX,
        },
    }
}

pub(super) fn slots() -> Slots {
    const MOST: u32 = u32::MAX;
    let slot = SlotInfo {
        state: SlotState::Trial,
        table: Some(TableName {
            id: MOST,
            version: MOST,
        }),
        length: MOST,
        erases: MOST,
        about: Some(TableAbout {
            label: crate::image::Label::new(&"x".repeat(32), MOST),
            frames: KIND,
        }),
    };
    Slots {
        slots: [slot; 2],
        target: u8::MAX,
        trial_ms: MOST,
        oldest: MOST,
        key: Some([u8::MAX; _]),
        device: u64::MAX,
        sector: MOST,
        record_erases: MOST,
        sequence: MOST,
        ended: Some(EndedTrial {
            table: MOST,
            reason: TableReason::RolledBack,
            ago_ms: MOST,
        }),
    }
}

impl Device for FullDevice {
    fn identity(&self) -> Hello {
        identity()
    }

    fn carry_out(&mut self, _: Request<'_>, _: u64) -> Response {
        Response::Slots(slots())
    }

    fn status(&self) -> Status {
        const MOST: u32 = u32::MAX;
        Status {
            firmware: VERSION,
            board: name(),
            uptime_ms: u64::MAX,
            table: Some(TableName {
                id: MOST,
                version: MOST,
            }),
            mode: Mode::PassThrough(PassThrough::Memory),
            tier: u8::MAX,
            top_tier: u8::MAX,
            frames: FrameCounts {
                received: MOST,
                shown: MOST,
                late: MOST,
                dropped: MOST,
                broken: MOST,
            },
            clipping: Clipping {
                last: ClippedSamples {
                    black: MOST,
                    white: MOST,
                },
                black: u64::MAX,
                white: u64::MAX,
                samples: MOST,
            },
            frame_time: FrameTime {
                last_us: MOST,
                mean_us: MOST,
                worst_us: MOST,
                budget_us: MOST,
            },
            slots: [SlotState::Trial; 2],
            last_fault: Some(Fault::Frame {
                sequence: MOST,
                cause: FaultyFrame::Superseded,
            }),
            stack: Stack {
                used: MOST,
                size: MOST,
            },
            watchdog_resets: MOST,
            serial: SerialCounts {
                bad: MOST,
                unsent: MOST,
            },
            input: Some(KIND),
        }
    }
}
