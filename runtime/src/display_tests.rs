//! What a person reads of the runtime's errors and states: every value says something, and no two
//! of a type say the same.

use crate::frame_buffers::{AttachError, Broken, RegionError};
use crate::link::{
    Fault, FaultyFrame, FrameKind, LinkFrameError, Mode, PassThrough, Refusal, SlotState,
    SourceFault, TableName, TableReason, TierReason, Version,
};
use crate::store::{MapError, StoreError};
use crate::trust::{NoRight, Rejected};
use std::collections::BTreeSet;
use std::fmt::{Debug, Display};
use std::string::ToString;

fn all_differ<T: Display + Debug>(values: &[T]) {
    let mut said = BTreeSet::new();
    for value in values {
        let text = value.to_string();
        assert!(!text.trim().is_empty(), "{value:?} says nothing");
        assert!(said.insert(text), "{value:?} says what another one says");
    }
}

#[test]
fn devices_and_their_links() {
    all_differ(&[
        LinkFrameError::Cobs,
        LinkFrameError::TooLong,
        LinkFrameError::TooShort,
        LinkFrameError::Checksum,
        LinkFrameError::Channel { number: 7 },
        LinkFrameError::Channel { number: 8 },
    ]);
    let unsigned = TableName { id: 1, version: 0 };
    let signed = TableName { id: 1, version: 2 };
    all_differ(&[unsigned, signed, TableName { id: 2, ..signed }]);
    all_differ(&[
        Refusal::HelloFirst,
        Refusal::Unknown,
        Refusal::Malformed,
        Refusal::NoTransfer,
        Refusal::TooLong { limit: 4096 },
        Refusal::OnTrial,
        Refusal::Chunk,
        Refusal::Flash { offset: 64 },
        Refusal::Incomplete,
        Refusal::Table(Rejected::Truncated),
        Refusal::Table(Rejected::Damaged),
        Refusal::NotInUse { table: None },
        Refusal::NotInUse {
            table: Some(signed),
        },
        Refusal::NoOther,
        Refusal::HasKey,
        Refusal::ReadOnly,
        Refusal::KeyLost,
        Refusal::NoRight(NoRight::Missing),
        Refusal::NoRight(NoRight::Signature),
        Refusal::Wear { wait_s: 9 },
    ]);
    all_differ(&[
        TableReason::Trial,
        TableReason::Confirmed,
        TableReason::TrialOver,
        TableReason::RolledBack,
        TableReason::Damaged,
    ]);
    all_differ(&[
        TierReason::OverBudget,
        TierReason::TimeToSpare,
        TierReason::NewStart,
    ]);
    let version = |major, minor, patch| Version {
        major,
        minor,
        patch,
    };
    all_differ(&[version(1, 2, 3), version(1, 3, 2), version(2, 1, 3)]);
}

#[test]
fn states_of_a_device() {
    let kind = |width, channels| FrameKind {
        width,
        height: 4,
        channels,
    };
    all_differ(&[kind(4, 1), kind(4, 3), kind(8, 1)]);
    assert!(kind(4, 1).to_string().starts_with("grey"));
    all_differ(&[
        Mode::Compensating,
        Mode::PassThrough(PassThrough::NoTable),
        Mode::PassThrough(PassThrough::BrokenTable),
        Mode::PassThrough(PassThrough::OtherFrames),
        Mode::PassThrough(PassThrough::Memory),
        Mode::PassThrough(PassThrough::CrashLoop),
    ]);
    all_differ(&[
        SlotState::Empty,
        SlotState::Valid,
        SlotState::Broken,
        SlotState::Active,
        SlotState::Trial,
        SlotState::Unconfirmed,
    ]);
    let table = |slot| Fault::Table {
        slot,
        cause: Rejected::Damaged,
    };
    let frame = |cause| Fault::Frame { sequence: 5, cause };
    all_differ(&[
        table(0),
        table(1),
        frame(FaultyFrame::Torn),
        frame(FaultyFrame::Short),
        frame(FaultyFrame::Stale),
        frame(FaultyFrame::Superseded),
        Fault::Source(SourceFault::Version),
        Fault::Source(SourceFault::Format),
        Fault::Source(SourceFault::TooLarge),
        Fault::Watchdog,
        Fault::Crash,
        Fault::KeyLost,
    ]);
    assert!(table(0).to_string().starts_with("slot A"));
}

#[test]
fn tables_rights_and_flash() {
    all_differ(&[
        Rejected::NotATable,
        Rejected::Truncated,
        Rejected::Format,
        Rejected::Damaged,
        Rejected::Contents,
        Rejected::Unsigned,
        Rejected::WrongKey,
        Rejected::Signature,
        Rejected::Older {
            version: 1,
            floor: 2,
        },
        Rejected::OtherDevice { device: 3 },
    ]);
    all_differ(&[
        NoRight::Missing,
        NoRight::Signature,
        NoRight::Certificate,
        NoRight::OtherDevice { device: 3 },
        NoRight::Revoked {
            version: 1,
            floor: 2,
        },
    ]);
    all_differ(&[StoreError::Flash { offset: 64 }, StoreError::Full]);
    all_differ(&[
        MapError::Sectors { start: 64 },
        MapError::Place { start: 64 },
        MapError::Slots,
        MapError::Unit,
    ]);
}

#[test]
fn frame_memory() {
    let region = RegionError {
        needed: 100,
        given: 64,
    };
    all_differ(&[
        AttachError::NoSource,
        AttachError::Version { found: 9 },
        AttachError::Format,
        AttachError::Region(region),
    ]);
    all_differ(&[
        Broken::Torn,
        Broken::Short,
        Broken::Stale,
        Broken::Superseded,
    ]);
    let faults = [
        AttachError::Version { found: 9 },
        AttachError::Format,
        AttachError::Region(region),
    ];
    let faults = faults.map(|error| SourceFault::of(&error));
    assert_eq!(
        faults,
        [
            Some(SourceFault::Version),
            Some(SourceFault::Format),
            Some(SourceFault::TooLarge)
        ]
    );
    assert_eq!(SourceFault::of(&AttachError::NoSource), None);
}
