//! Session fuzzer: the device session against a model of it.
//!
//! ```text
//! bytes -> Op, Op, ... -> frames -> Session -> Updater -> NOR simulator
//!                   \                 |           |            |
//!                    -> Model ------- answers --- states ----- bytes in flash: equal?
//! ```
//!
//! After a power cut, or bits that rot in the records, more than one state is legal:
//! then there are as many models, and those go that the device does not agree with.
//! Some must be left.

mod model;
mod op;
mod wire;

pub(super) use op::OP;

use super::files::{Owner, files, keys, signer};
use crate::flash_simulator::{NorSimulator, Violations, Wear};
use crate::slots::{SimDevice, SlotLayout};
use ed25519_dalek::{Signer, SigningKey};
use iltm_runtime::link::{Channel, Event, PROTOCOL_VERSION, Refusal, Request, Response, Status};
use iltm_runtime::store::Slot;
use iltm_runtime::trust::{Certificate, Deed};
use model::{Model, Record, Sizes};
use op::{MAX_OPS, Op, Proof, Twist, Which};
use wire::{Noise, Said, Wire, framed, payload};

/// What happens to a device: the first byte says what its flash is like, every four
/// bytes after it are something that happens.
///
/// # Panics
/// If the device does anything but what the model says.
pub fn session(bytes: &[u8]) {
    let Some((kind, ops)) = bytes.split_first() else {
        return;
    };
    let (ops, _) = ops.as_chunks::<OP>();
    let ops = ops.iter().take(MAX_OPS).map(|op| Op::decode(*op));
    // 768 or 1,024 bytes a slot; a record part has room for 1, 3, 4 or 8 records; a
    // sector has 1 or 3 chunks.
    match kind % 8 {
        0 => live::<1, 64>(12, false, ops),
        1 => live::<4, 192>(4, false, ops),
        2 => live::<8, 256>(3, false, ops),
        3 => live::<32, 512>(2, false, ops),
        4 => live::<1, 128>(6, true, ops),
        5 => live::<16, 192>(4, true, ops),
        6 => live::<32, 256>(3, true, ops),
        _ => live::<16, 128>(6, true, ops),
    }
}

/// What is in the bytes of an execution, for people.
pub fn described(bytes: &[u8]) -> String {
    let Some((kind, ops)) = bytes.split_first() else {
        return String::new();
    };
    let (ops, _) = ops.as_chunks::<OP>();
    let ops = ops.iter().take(MAX_OPS).map(|op| Op::decode(*op));
    let ops: Vec<_> = ops.map(|op| format!("{op:?}")).collect();
    format!("flash {}\n{}", kind % 8, ops.join("\n"))
}

fn live<const W: usize, const E: usize>(slot: usize, weak: bool, ops: impl Iterator<Item = Op>) {
    let mut trial = Trial::<W, E>::new(slot, weak);
    for op in ops {
        trial.happens(op);
    }
    trial.flush();
    trial.restart();
}

/// What is wrong with a flash.
struct Harm {
    /// Bits that a cut caught in motion read as either.
    weak: bool,
    /// Records or the key's sector are worn: a request that writes there may be refused.
    worn: bool,
}

/// A device, its models, and the host's end of the line.
struct Trial<const W: usize, const E: usize> {
    wire: Option<Wire<W, E>>,
    models: Vec<Model>,
    /// Every record that there may have been.
    records: Vec<Option<Record>>,
    layout: SlotLayout,
    sequence: u16,
    greeted: bool,
    noise: Noise,
    /// Requests under way: frames, and who they are from.
    held: Vec<Held>,
    together: usize,
    last: Option<Held>,
    /// The last request was answered, and nothing has happened since.
    fresh: bool,
    harm: Harm,
    /// Steps of the flash in a request until the power fails.
    cut_after: Option<u64>,
}

#[derive(Clone)]
struct Held {
    sequence: u16,
    payload: Vec<u8>,
    /// What must come of it where the payload is no request.
    refusal: Option<Refusal>,
}

impl<const W: usize, const E: usize> Trial<W, E> {
    fn new(slot: usize, weak: bool) -> Self {
        let layout = SlotLayout { slot, sector: E };
        let flash = NorSimulator::new(layout.sectors(), 1);
        let flash = if weak { flash.with_weak_bits() } else { flash };
        let device = SimDevice::start(flash, layout);
        let map = device.updater.map();
        let sizes = Sizes {
            slot: (slot * E) as u32,
            sector: map.sector(),
            chunk: u32::from(map.chunk()),
        };
        Self {
            wire: Some(Wire::new(device)),
            models: vec![Model::new(sizes)],
            records: vec![None],
            layout,
            sequence: 0,
            greeted: false,
            noise: Noise::default(),
            held: Vec::new(),
            together: 0,
            last: None,
            fresh: false,
            harm: Harm { weak, worn: false },
            cut_after: None,
        }
    }

    fn wire(&mut self) -> &mut Wire<W, E> {
        self.wire.as_mut().expect("there is a device")
    }

    fn model(&self) -> &Model {
        self.models.first().expect("a model is left")
    }

    fn happens(&mut self, op: Op) {
        let fresh = std::mem::take(&mut self.fresh);
        match op {
            Op::Hello => self.request(&Request::Hello {
                protocol: PROTOCOL_VERSION,
            }),
            Op::Status => self.request(&Request::Status),
            Op::Slots => self.request(&Request::Slots),
            Op::Subscribe { period_ms } => self.request(&Request::Subscribe { period_ms }),
            Op::Sectors { length, first } => self.request(&Request::Sectors { length, first }),
            Op::Begin { file, more, proof } => self.begin(file, more, proof),
            Op::Write { file, chunk, twist } => self.write(file, chunk, twist),
            Op::Send { file, sparing } => self.send(file, sparing),
            Op::Activate { file, trial_s } => {
                let transfer = files()[file].digest.transfer();
                self.request(&Request::Activate { transfer, trial_s });
            }
            Op::Confirm { table, proof } => {
                let table = self.which(table);
                let right = &self.right(&Deed::Confirm { table }, proof);
                self.request(&Request::Confirm { table, right });
            }
            Op::Rollback { table, proof } => {
                let table = self.which(table);
                let right = &self.right(&Deed::Rollback { table }, proof);
                self.request(&Request::Rollback { table, right });
            }
            Op::Provision {
                key,
                device,
                even_so,
            } => self.request(&Request::Provision {
                key,
                device,
                even_so,
            }),
            Op::Again => self.again(fresh),
            Op::Together { count } => {
                self.flush();
                // Which of several requests was cut or refused is hard to tell.
                if self.cut_after.is_none() && !self.harm.worn {
                    self.together = count;
                }
            }
            Op::Odd { request, how } => self.odd(request, how),
            Op::Garbage { seed, length, end } => self.garbage(seed, length, end),
            Op::OtherChannel { channel } => self.other_channel(channel),
            Op::Wait { ms } => self.wait(ms),
            Op::Restart => {
                self.flush();
                self.restart();
            }
            Op::Cut { steps } => {
                self.flush();
                self.cut_after = Some(steps);
            }
            Op::Rot { slot, at, bits } => self.rot(slot, at, bits),
            Op::RotRecords { bits } => self.rot_records(bits),
            Op::Wear { sector, how } => self.wear(sector, how),
            Op::Put { slot, file } => self.put(slot, file),
        }
    }

    fn which(&self, which: Which) -> u32 {
        let table = match which {
            Which::InUse => self.model().table(),
            Which::Other => self.model().other(),
            Which::Unknown => None,
        };
        table.map_or(0xDEAD_BEEF, |table| table.id)
    }

    fn request(&mut self, request: &Request<'_>) {
        self.sequence = self.sequence.wrapping_add(1);
        self.hold(Held {
            sequence: self.sequence,
            payload: payload(request),
            refusal: None,
        });
    }

    fn hold(&mut self, held: Held) {
        self.last = Some(held.clone());
        self.held.push(held);
        if self.held.len() >= self.together {
            self.flush();
        }
    }

    fn begin(&mut self, file: usize, more: i32, proof: Proof) {
        let file = &files()[file];
        let length = (file.bytes.len() as u32).saturating_add_signed(more);
        let digest = file.digest;
        let right = &self.right(&Deed::Begin { length, digest }, proof);
        self.request(&Request::Begin {
            length,
            digest,
            right,
        });
    }

    /// What the device wants to see signed next.
    fn sequence(&mut self) -> u32 {
        match self.wire().device.ask(Request::Slots) {
            Response::Slots(slots) => slots.sequence,
            other => panic!("not to a question for the slots: {other:?}"),
        }
    }

    /// A right, or something like it, to do this on the device as it is now.
    fn right(&mut self, deed: &Deed, proof: Proof) -> Vec<u8> {
        let sequence = self.sequence();
        let Some(owner) = self.model().owner else {
            return vec![7; 64];
        };
        // Nobody has the third key.
        let site = signer((keys()[1] == owner.key).into());
        let stranger = signer(4);
        let by = |key: &SigningKey, sequence| {
            let signature = key.sign(&deed.message(owner.device, sequence));
            signature.to_bytes().to_vec()
        };
        let certified = |by: &SigningKey, device, version| {
            let mut certificate = Certificate {
                key: stranger.verifying_key().to_bytes(),
                device,
                version,
                signature: [0; 64],
            };
            certificate.signature = by.sign(&certificate.message()).to_bytes();
            certificate.emit().to_vec()
        };
        match proof {
            Proof::Owner => by(&site, sequence),
            Proof::Technician { device, version } => {
                [by(&stranger, sequence), certified(&site, device, version)].concat()
            }
            Proof::Stranger { certified: false } => by(&stranger, sequence),
            Proof::Stranger { certified: true } => {
                [by(&stranger, sequence), certified(&stranger, 0, 9)].concat()
            }
            Proof::Stale => by(&site, sequence.wrapping_sub(1)),
            Proof::None { length } => by(&site, sequence)[..length].to_vec(),
        }
    }

    fn chunk(&mut self) -> usize {
        usize::from(self.wire().device.updater.map().chunk())
    }

    fn write(&mut self, file: usize, chunk: usize, twist: Twist) {
        let size = self.chunk();
        let file = &files()[file];
        let count = file.bytes.len().div_ceil(size).max(1);
        // Now and then beyond the end.
        let start = (chunk % (count + 1) * size).min(file.bytes.len());
        let end = (start + size).min(file.bytes.len());
        let mut bytes = file.bytes[start..end].to_vec();
        let mut offset = (chunk % (count + 1) * size) as u32;
        let mut transfer = file.digest.transfer();
        match twist {
            Twist::None => {}
            Twist::Offset => offset = offset.wrapping_sub(1),
            Twist::Short => bytes.truncate(bytes.len().saturating_sub(1)),
            Twist::Long => bytes.push(0),
            Twist::Transfer => transfer ^= 1,
            Twist::Bytes => bytes.iter_mut().for_each(|byte| *byte ^= 0x24),
        }
        self.request(&Request::Write {
            transfer,
            offset,
            bytes: &bytes,
        });
    }

    fn send(&mut self, file: usize, sparing: bool) {
        self.begin(file, 0, Proof::Owner);
        let size = self.chunk();
        let sector = self.wire().device.updater.map().sector() as usize;
        let file = &files()[file];
        let transfer = file.digest.transfer();
        for (index, bytes) in file.bytes.chunks(size).enumerate() {
            let offset = index * size;
            let start = offset / sector * sector;
            let end = file.bytes.len().min(start + sector);
            let model = self.model();
            let held = model.slots[model.target()].get(start..end);
            // What was held when its first chunk was due is not sent.
            if sparing && held == Some(&file.bytes[start..end]) {
                continue;
            }
            self.request(&Request::Write {
                transfer,
                offset: offset as u32,
                bytes,
            });
        }
        let trial_s = 60;
        self.request(&Request::Activate { transfer, trial_s });
    }

    /// The last request once more. At once after the first time, it changes nothing.
    fn again(&mut self, fresh: bool) {
        let Some(last) = self.last.clone() else {
            return;
        };
        self.flush();
        let fresh = fresh || self.fresh;
        let before: Vec<_> = self.models.iter().map(Model::kept).collect();
        self.hold(last);
        self.flush();
        let after = self.models.iter().map(Model::kept);
        // Unless the power has failed.
        let answered = self.fresh;
        assert!(
            !fresh || !answered || after.eq(before),
            "a request that is repeated does harm"
        );
    }

    fn odd(&mut self, request: u8, how: u8) {
        self.sequence = self.sequence.wrapping_add(1);
        let requests = [
            Request::Hello {
                protocol: PROTOCOL_VERSION,
            },
            Request::Subscribe { period_ms: 700 },
            Request::Sectors {
                length: 300,
                first: 1,
            },
            Request::Confirm {
                table: 77,
                right: &[],
            },
            Request::Provision {
                key: [9; 32],
                device: 1 << 60,
                even_so: true,
            },
        ];
        let mut payload = payload(&requests[usize::from(request) % requests.len()]);
        let refusal = match how % 4 {
            0 => {
                payload.push(how);
                Refusal::Malformed
            }
            1 => {
                payload[0] = 11 + how / 2;
                Refusal::Unknown
            }
            2 => {
                payload.clear();
                Refusal::Malformed
            }
            _ => {
                payload.truncate(1 + usize::from(how / 4) % (payload.len() - 1));
                Refusal::Malformed
            }
        };
        self.hold(Held {
            sequence: self.sequence,
            payload,
            refusal: Some(refusal),
        });
    }

    fn garbage(&mut self, seed: u8, length: u8, end: bool) {
        self.flush();
        let mut random = fastrand::Rng::with_seed(u64::from(seed));
        let mut bytes: Vec<u8> = (0..u32::from(length) * 4).map(|_| random.u8(..)).collect();
        if end {
            bytes.push(0);
        }
        self.noise.add(&bytes);
        let said = self.wire().hear(&bytes, 64);
        self.no_answer(&said);
    }

    fn other_channel(&mut self, channel: u8) {
        self.flush();
        let channel = match channel {
            0 | 1 => Channel::Response,
            2 => Channel::Event,
            _ => Channel::Log,
        };
        let frame = framed(channel, self.sequence, &[0, 1]);
        self.noise.frame();
        let said = self.wire().hear(&frame, 7);
        self.no_answer(&said);
    }

    fn no_answer(&mut self, said: &Said) {
        assert!(said.responses.is_empty(), "nobody asked: {said:?}");
        self.events(said);
    }

    fn wait(&mut self, ms: u64) {
        self.flush();
        self.fresh = false;
        let said = self.wire().wait(ms);
        let now = self.wire().device.now_ms;
        for model in &mut self.models {
            model.poll(now);
        }
        self.no_answer(&said);
        self.agree("after a while");
    }

    fn events(&mut self, said: &Said) {
        for event in &said.events {
            match event {
                Event::Status(status) => self.status(status),
                Event::TableChanged { .. } => {}
                _ => panic!("nothing of the kind happened: {event:?}"),
            }
        }
    }

    fn status(&self, status: &Status) {
        assert_eq!(status.table, self.model().table(), "the table in a status");
        assert_eq!(status.slots, self.model().states(), "the slots in a status");
        assert_eq!(status.serial.bad, self.noise.bad, "bad frames");
        assert_eq!(status.serial.unsent, 0, "there was room for every answer");
    }

    /// The requests that are held reach the device.
    fn flush(&mut self) {
        self.together = 0;
        let held = std::mem::take(&mut self.held);
        if held.is_empty() {
            return;
        }
        let mut bytes = Vec::new();
        let mut expected = Vec::new();
        let before = self.models.clone();
        let now = self.wire().device.now_ms;
        let sequence = self.sequence();
        for model in &mut self.models {
            model.sequence = Some(sequence);
        }
        for held in &held {
            bytes.extend(framed(Channel::Request, held.sequence, &held.payload));
            if self.noise.frame() {
                expected.push((held.sequence, self.predict(held, now)));
            }
        }
        let cut = self.cut_after.filter(|_| self.may_cut(&held));
        if let Some(steps) = cut {
            self.cut_after = None;
            self.wire().device.updater.flash_mut().cut_after(steps);
        }
        let piece = usize::from(self.sequence) % 97;
        let said = self.wire().hear(&bytes, piece);
        if !self.wire().device.flash().is_on() {
            return self.cut(before);
        }
        // A cut that did not come true is forgotten.
        self.wire().device.updater.flash_mut().power_on();
        let numbers = |said: &Said| said.responses.iter().map(|said| said.0).collect::<Vec<_>>();
        let wanted: Vec<_> = expected.iter().map(|expected| expected.0).collect();
        assert_eq!(numbers(&said), wanted, "one answer to each request");
        let said_last = wanted.last().copied();
        for ((_, mut response), (_, predicted)) in said.responses.into_iter().zip(expected) {
            if self.was_too_worn(&held, &response) {
                self.models = unchanged(&before, &self.models);
            } else {
                self.compare(&mut response, &predicted);
            }
        }
        self.fresh = said_last == held.last().map(|held| held.sequence);
        self.agree("after a request");
    }

    /// What weak bits in a slot read as differs from one time to the next; that they
    /// do no harm is for `tests/tests/device/power_cuts.rs`. Here only records have them.
    fn may_cut(&self, held: &[Held]) -> bool {
        let [held] = held else {
            return false;
        };
        let request = Request::parse(&held.payload);
        // What a cut leaves and what wear leaves are two questions.
        !self.harm.worn && (!self.harm.weak || !matches!(request, Ok(Request::Write { .. })))
    }

    /// Whether a request was refused because its record or the key could not be written.
    fn was_too_worn(&self, held: &[Held], response: &Response) -> bool {
        let [held] = held else {
            return false;
        };
        let writes = matches!(
            Request::parse(&held.payload),
            Ok(Request::Begin { .. }
                | Request::Confirm { .. }
                | Request::Rollback { .. }
                | Request::Provision { .. })
        );
        let refusal = matches!(
            response,
            Response::Refused(Refusal::ReadOnly | Refusal::Flash { .. })
        );
        self.harm.worn && writes && refusal
    }

    fn wear(&mut self, sector: usize, how: Wear) {
        self.flush();
        if self.harm.worn {
            return;
        }
        self.harm.worn = true;
        self.cut_after = None;
        let first = self.layout.slot(Slot::B).end / self.layout.sector;
        let flash = self.wire().device.updater.flash_mut();
        let erases = flash.erases(first + sector).expect("there");
        let worn = flash.wear_out(first + sector, erases, how);
        worn.expect("there");
    }

    /// What each model says to a request.
    fn predict(&mut self, held: &Held, now: u64) -> Predicted {
        if let Some(refusal) = held.refusal {
            return Predicted::All(Response::Refused(refusal));
        }
        let request = Request::parse(&held.payload).expect("a request");
        match request {
            Request::Hello { .. } => {
                self.greeted = true;
                let device = self.model().owner.map_or(0, |owner| owner.device);
                Predicted::Hello { device }
            }
            _ if !self.greeted => Predicted::All(Response::Refused(Refusal::HelloFirst)),
            Request::Status => Predicted::Status,
            Request::Subscribe { period_ms } => Predicted::All(Response::Subscribed {
                period_ms: match period_ms {
                    0 => 0,
                    _ => period_ms.max(100),
                },
                lapse_ms: 5_000,
            }),
            _ => {
                let answers = self.models.iter_mut();
                let answers = answers.map(|model| model.answer(&request, now)).collect();
                self.keep_records();
                Predicted::Each(answers)
            }
        }
    }

    fn keep_records(&mut self) {
        for model in &self.models {
            if !self.records.contains(&model.record) {
                self.records.push(model.record);
            }
        }
    }

    fn compare(&mut self, response: &mut Response, predicted: &Predicted) {
        if let Response::Slots(slots) = response {
            // How often it was erased since it was made is known after a cut only
            // roughly.
            slots.record_erases = 0;
            for slot in &mut slots.slots {
                slot.erases = 0;
                // What a table is called is for `tests/tests/device/slots.rs`.
                slot.about = None;
            }
            slots.sequence = 0;
        }
        match predicted {
            Predicted::All(wanted) => assert_eq!(response, wanted, "a response"),
            Predicted::Hello { device } => {
                let Response::Hello(hello) = response else {
                    panic!("not to a hello: {response:?}");
                };
                assert_eq!(hello.device, *device, "the number in a hello");
            }
            Predicted::Status => {
                let Response::Status(status) = response else {
                    panic!("not to a question for the status: {response:?}");
                };
                assert_eq!(status.serial.bad, self.noise.bad, "bad frames");
            }
            Predicted::Each(wanted) => {
                let mut wanted_by = wanted.iter();
                self.models.retain(|_| wanted_by.next() == Some(response));
                assert!(
                    !self.models.is_empty(),
                    "a response\n got: {response:?}\nwant: {wanted:?}"
                );
            }
        }
    }

    /// The device is as one of the models says, and holds to the rules of its flash.
    fn agree(&mut self, when: &str) {
        let wire = self.wire.as_ref().expect("there is a device");
        let some = self.models.clone();
        self.models
            .retain(|model| agrees(&wire.device, model).is_ok());
        if self.models.is_empty() {
            let what = some.iter().map(|model| agrees(&wire.device, model));
            panic!("{when}: {:#?}", what.collect::<Vec<_>>());
        }
        let violations = wire.device.flash().violations();
        assert_eq!(violations, Violations::default(), "{when}");
    }

    /// The power has failed in a request: before it or after it is the same to the
    /// device when it starts, but nothing else.
    fn cut(&mut self, mut before: Vec<Model>) {
        let flash = self.wire().device.flash().contents().to_vec();
        let after = std::mem::take(&mut self.models);
        for (before, after) in before.iter_mut().zip(&after) {
            before.touched.clone_from(&after.touched);
        }
        before = unchanged(&before, &after);
        before.extend(after);
        for model in &mut before {
            if let Some((slot, range)) = model.touched.clone() {
                let at = self.layout.slot(Slot::ALL[slot]).start;
                let now = &flash[at + range.start..at + range.end];
                model.slots[slot][range].copy_from_slice(now);
            }
        }
        self.models = before;
        self.restart();
    }

    /// Off and on again; what is in RAM is lost, in the models as well.
    fn restart(&mut self) {
        self.again_with(|_| {});
    }

    /// Off, something done to the flash, and on again.
    fn again_with(&mut self, change: impl FnOnce(&mut NorSimulator<W, E>)) {
        let wire = self.wire.take().expect("there is a device");
        let mut flash = wire.device.updater.into_flash();
        change(&mut flash);
        flash.power_on();
        self.wire = Some(Wire::new(SimDevice::start(flash, self.layout)));
        self.cut_after = None;
        self.greeted = false;
        self.noise = Noise::default();
        self.last = None;
        for model in &mut self.models {
            model.start();
        }
        self.models.dedup();
        self.agree("after a start");
    }

    fn rot(&mut self, slot: usize, at: u16, bits: usize) {
        self.flush();
        let layout = self.layout;
        let place = layout.slot(Slot::ALL[slot]);
        let length = place.len();
        let at = usize::from(at) % length;
        for model in &mut self.models {
            for bit in 0..bits {
                model.slots[slot][(at + bit) % length] ^= 1 << (bit % 8);
            }
        }
        let bytes = self.model().slots[slot].clone();
        self.again_with(|flash| flash.put(place.start as u32, &bytes).expect("it fits"));
    }

    fn put(&mut self, slot: usize, file: usize) {
        self.flush();
        let place = self.layout.slot(Slot::ALL[slot]);
        let file = &files()[file].bytes;
        for model in &mut self.models {
            model.slots[slot].fill(0xFF);
            model.slots[slot][..file.len()].copy_from_slice(file);
        }
        let bytes = self.model().slots[slot].clone();
        self.again_with(|flash| flash.put(place.start as u32, &bytes).expect("it fits"));
    }

    fn rot_records(&mut self, bits: usize) {
        self.flush();
        if self.harm.worn {
            return;
        }
        let start = self.layout.slot(Slot::B).end;
        let end = start + 2 * self.layout.sector;
        let models = std::mem::take(&mut self.models);
        for model in models {
            // Any earlier record may count now, or none.
            for record in &self.records {
                let mut other = model.clone();
                other.record = *record;
                self.models.push(other);
            }
            self.models.push(model);
        }
        self.again_with(|flash| flash.rot(start as u32..end as u32, bits).expect("it fits"));
    }
}

/// Models after a request that was not carried out, from those before it and those after it
/// was. The first record comes before a key: there may be the one without the other.
fn unchanged(before: &[Model], after: &[Model]) -> Vec<Model> {
    let mut all = before.to_vec();
    for (before, after) in before.iter().zip(after) {
        if before.owner != after.owner {
            let mut between = before.clone();
            between.record = after.record;
            all.push(between);
        }
    }
    all
}

/// What must come of a request.
#[derive(Debug)]
enum Predicted {
    All(Response),
    /// One with this number of the device.
    Hello {
        device: u64,
    },
    Status,
    /// By model.
    Each(Vec<Response>),
}

/// Where a device is not as a model says.
fn agrees<const W: usize, const E: usize>(
    device: &SimDevice<W, E>,
    model: &Model,
) -> Result<(), String> {
    let same =
        |what: &str, same: bool, found: &dyn std::fmt::Debug, wanted: &dyn std::fmt::Debug| {
            if same {
                Ok(())
            } else {
                Err(format!("{what}: {found:?}, and the model says {wanted:?}"))
            }
        };
    let updater = &device.updater;
    let in_use = updater.in_use().map(Slot::index);
    same("in use", in_use == model.in_use, &in_use, &model.in_use)?;
    let selected = device.tables.selected.ok().map(Slot::index);
    same("frames", selected == model.in_use, &selected, &model.in_use)?;
    let (states, wanted) = (updater.states(), model.states());
    same("states", states == wanted, &states, &wanted)?;
    let (table, wanted) = (updater.table(), model.table());
    same("table", table == wanted, &table, &wanted)?;
    let trust = updater.trust();
    let owner = trust.key.map(|key| Owner {
        key,
        device: trust.device,
    });
    same("owner", owner == model.owner, &owner, &model.owner)?;
    for slot in Slot::ALL {
        let bytes = &device.flash().contents()[device.layout().slot(slot)];
        let wanted = &model.slots[slot.index()];
        same("a slot's bytes", bytes == wanted, &bytes, &wanted)?;
    }
    Ok(())
}
