//! Code coverage of a firmware: which code a run comes to, by the emulator's own record.
//!
//! With `-d in_asm` QEMU writes down every block of instructions when it translates it,
//! which it does when the program first gets there and never before. The ELF file says
//! whose instructions they are: the symbol around an address, and the functions that
//! were inlined there with their files, from the line tables.

use addr2line::Loader;
use std::collections::BTreeSet;
use std::path::Path;

/// A piece of code.
#[derive(Clone, PartialEq, Eq, PartialOrd, Ord, Debug)]
pub struct Place {
    /// Its file, from `runtime/` on; empty where none is known.
    pub file: String,
    /// Its function, without its module and with its types; what is written in assembler
    /// has its symbol here.
    pub function: String,
}

/// Everything that a run has come to.
#[derive(Clone, Default, Debug)]
pub struct Executed(BTreeSet<Place>);

impl Executed {
    /// From what QEMU wrote down while it ran an ELF file.
    pub fn read(log: &Path, elf: &Path) -> Self {
        let log = std::fs::read_to_string(log).expect("QEMU wrote it");
        let addresses: BTreeSet<u64> = log.lines().filter_map(address).collect();
        assert!(
            !addresses.is_empty(),
            "QEMU has written no instructions down"
        );
        let loader = Loader::new(elf).expect("an ELF file with line tables");
        let mut places = BTreeSet::new();
        for address in addresses {
            // Of Thumb code, symbols have an odd address and line tables an even one.
            let symbol = loader.find_symbol(address | 1);
            if let Some(name) = symbol.filter(|name| name.starts_with("iltm_")) {
                places.insert(Place {
                    file: String::new(),
                    function: name.to_owned(),
                });
            }
            places.extend(inlined(&loader, address));
        }
        Self(places)
    }

    /// Those of both.
    pub fn and(mut self, other: Self) -> Self {
        self.0.extend(other.0);
        self
    }

    /// The places that fit.
    pub fn of(&self, code: &Code) -> impl Iterator<Item = &Place> {
        self.0.iter().filter(|place| code.holds(place))
    }
}

/// What tells some code from other code.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Code {
    /// All of a file, or of a folder, of the runtime.
    File(&'static str),
    /// A function of a file of the runtime, with any types.
    Function(&'static str, &'static str),
    /// Functions of a folder of the runtime that exist once for every number, in the
    /// instance for this one.
    Instance(&'static str, u8),
    /// What is written in assembler and has a symbol that contains this.
    Symbol(&'static str),
    /// The same with one of these symbols.
    OneOf(&'static [&'static str]),
}

impl Code {
    fn holds(&self, place: &Place) -> bool {
        match self {
            Self::File(file) => place.file.starts_with(file),
            Self::Function(file, name) => {
                let own = place.function.split('<').next();
                place.file == *file && own == Some(name)
            }
            Self::Instance(folder, number) => {
                let only = place.function.ends_with(&format!("<{number}>"));
                let first = place.function.contains(&format!("<{number}, "));
                place.file.starts_with(folder) && (only || first)
            }
            Self::Symbol(part) => {
                place.function.starts_with("iltm_") && place.function.contains(part)
            }
            Self::OneOf(names) => names.contains(&place.function.as_str()),
        }
    }
}

/// The functions that an address is in, one inlined in the other. What the check of a
/// table has inlined is the check's: it asks of every stage whether the table lists it.
fn inlined(loader: &Loader, address: u64) -> Vec<Place> {
    let mut frames = loader.find_frames(address).expect("line tables");
    let mut places = Vec::new();
    while let Some(frame) = frames.next().expect("line tables") {
        // Line 0: the compiler's own, or merged from several.
        let location = frame.location.filter(|location| location.line > Some(0));
        let file = location.and_then(|location| location.file);
        let name = frame
            .function
            .as_ref()
            .map(addr2line::FunctionName::raw_name);
        let name = name.and_then(Result::ok).unwrap_or_default();
        places.push(Place {
            file: own(file.unwrap_or_default()),
            function: name.into_owned(),
        });
    }
    if places.iter().any(|place| place.file == CHECK) {
        places.retain(|place| place.file == CHECK);
    }
    places
}

const CHECK: &str = "runtime/src/image/check.rs";

/// `0x00008478:  b5f0       push ...`
fn address(line: &str) -> Option<u64> {
    let (address, _) = line.strip_prefix("0x")?.split_once(':')?;
    u64::from_str_radix(address, 16).ok()
}

/// A file of the runtime from `runtime/` on, which is where the firmware's build begins.
fn own(file: &str) -> String {
    let file = format!("/{file}");
    file.rfind("/runtime/src/")
        .map_or(String::new(), |start| file[start + 1..].to_owned())
}
