//! Transcript of a line, in words, for support.

use super::Line;
use iltm_runtime::{
    link::{Channel, Decoder, Event, LinkFrame, Request, Response},
    trust::KEY_ID,
};
use std::fmt::Write as _;
use std::io::{self, Write};
use std::time::{Duration, Instant};

/// A line whose frames are written down, one a line of text: seconds since the start,
/// `>` to the device or `<` from it, number and words. Of keys only ids are.
pub struct Transcribed<L> {
    line: L,
    sink: Option<Box<dyn Write + Send>>,
    start: Instant,
    to_device: Decoder,
    to_host: Decoder,
}

impl<L: std::fmt::Debug> std::fmt::Debug for Transcribed<L> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Transcribed")
            .field("line", &self.line)
            .finish_non_exhaustive()
    }
}

impl<L: Line> Transcribed<L> {
    /// A line that is not written down yet.
    pub fn new(line: L) -> Self {
        let start = line.now();
        Self {
            line,
            sink: None,
            start,
            to_device: Decoder::new(),
            to_host: Decoder::new(),
        }
    }

    /// The line itself.
    pub const fn line(&mut self) -> &mut L {
        &mut self.line
    }

    /// From now on frames are written down here. Nothing is said if that fails: the
    /// conversation matters more.
    pub fn write_to(&mut self, sink: Box<dyn Write + Send>) {
        self.sink = Some(sink);
    }

    /// Writes a remark down.
    pub fn remark(&mut self, words: &str) {
        let seconds = self.seconds();
        if let Some(sink) = &mut self.sink {
            let _ = writeln!(sink, "{seconds:10.3} - {words}");
            let _ = sink.flush();
        }
    }

    fn seconds(&self) -> f64 {
        let now = self.line.now();
        now.saturating_duration_since(self.start).as_secs_f64()
    }

    fn note(&mut self, bytes: &[u8], to_device: bool) {
        let seconds = self.seconds();
        let Some(sink) = &mut self.sink else {
            return;
        };
        let (decoder, way) = if to_device {
            (&mut self.to_device, '>')
        } else {
            (&mut self.to_host, '<')
        };
        for byte in bytes {
            let words = match decoder.push(*byte) {
                None => continue,
                Some(Ok(frame)) => format!("#{:05} {}", frame.sequence, words(frame)),
                Some(Err(error)) => format!("no frame: {error}"),
            };
            let _ = writeln!(sink, "{seconds:10.3} {way} {words}");
        }
    }
}

impl<L: Line> Line for Transcribed<L> {
    fn read(&mut self, bytes: &mut [u8], wait: Duration) -> io::Result<usize> {
        let count = self.line.read(bytes, wait)?;
        self.note(bytes.get(..count).unwrap_or_default(), false);
        Ok(count)
    }

    fn write(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.note(bytes, true);
        self.line.write(bytes)
    }

    fn now(&self) -> Instant {
        self.line.now()
    }
}

/// What a frame says.
fn words(frame: LinkFrame<'_>) -> String {
    let unread = || format!("{:?}: {} bytes", frame.channel, frame.payload.len());
    match frame.channel {
        Channel::Request => Request::parse(frame.payload).map_or_else(|_| unread(), asked),
        Channel::Response => {
            let response = postcard::from_bytes::<Response>(frame.payload);
            response.map_or_else(|_| unread(), |response| format!("{response:?}"))
        }
        Channel::Event => {
            let event = postcard::from_bytes::<Event>(frame.payload);
            event.map_or_else(|_| unread(), |event| format!("{event:?}"))
        }
        Channel::Log => format!("log: {}", hex(frame.payload)),
    }
}

/// A request, without the bytes of tables, keys and signatures.
fn asked(request: Request<'_>) -> String {
    match request {
        Request::Write {
            transfer,
            offset,
            bytes,
        } => format!(
            "Write {{ transfer: {transfer:08x}, offset: {offset}, {} bytes }}",
            bytes.len()
        ),
        Request::Provision { key, device, .. } => {
            let id = hex(key.get(..KEY_ID).unwrap_or_default());
            format!("Provision {{ key id: {id}, device: {device} }}")
        }
        Request::Begin {
            length,
            digest,
            right,
        } => format!(
            "Begin {{ length: {length}, digest: {}, right: {} bytes }}",
            hex(&digest.0),
            right.len()
        ),
        Request::Confirm { table, right } => {
            format!(
                "Confirm {{ table: {table:08x}, right: {} bytes }}",
                right.len()
            )
        }
        Request::Rollback { table, right } => {
            format!(
                "Rollback {{ table: {table:08x}, right: {} bytes }}",
                right.len()
            )
        }
        other => format!("{other:?}"),
    }
}

fn hex(bytes: &[u8]) -> String {
    let mut text = String::new();
    for byte in bytes {
        let _ = write!(text, "{byte:02x}");
    }
    text
}
