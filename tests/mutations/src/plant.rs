//! Planting of defects in a copy of the source.

use crate::areas::Area;
use quote::quote;
use serde::Deserialize;
use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::Path;
use std::process::Command;
use syn::spanned::Spanned;
use syn::visit_mut::{self, VisitMut};
use syn::{Block, Expr, ImplItemFn, ItemConst, ItemFn, ItemMod, ItemStatic, parse_quote};

/// A place in a file; both from 1.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug, Deserialize)]
pub struct Place {
    line: usize,
    column: usize,
}

#[derive(Clone, Copy, Debug, Deserialize)]
struct Span {
    start: Place,
    end: Place,
}

/// A defect as `cargo mutants` describes it.
#[derive(Clone, Debug, Deserialize)]
struct Listed {
    file: String,
    function: Option<Function>,
    span: Span,
    replacement: String,
    genre: String,
}

#[derive(Clone, Debug, Deserialize)]
struct Function {
    function_name: String,
}

/// A defect.
#[derive(Clone, Debug)]
pub struct Mutant {
    /// What chooses it.
    pub number: u32,
    /// Where it is counted.
    pub area: &'static Area,
    listed: Listed,
}

impl Mutant {
    /// Whether it lies in a line that is written like `order.rs:265`.
    pub fn lies_at(&self, line: &str) -> bool {
        format!("{}:{}", self.listed.file, self.listed.span.start.line).ends_with(line)
    }

    /// In words.
    pub fn words(&self) -> String {
        let Listed {
            file,
            function,
            span,
            replacement,
            genre,
        } = &self.listed;
        let name = function.as_ref().map_or("", |it| &it.function_name);
        let what = match genre.as_str() {
            "FnValue" => format!("always `{replacement}`"),
            "UnaryOperator" => "operator left out".to_owned(),
            _ => format!("operator becomes `{replacement}`"),
        };
        format!("{file}:{}, `{name}`: {what}", span.start.line)
    }
}

/// Defects of an area, evenly spaced among those of the kinds that can be planted.
pub fn choose(root: &Path, area: &'static Area) -> Vec<Mutant> {
    let mut mutants = Command::new("cargo");
    mutants.args(["mutants", "--list", "--json", "--workspace"]);
    for file in area.files {
        mutants.args(["--file", file]);
    }
    let output = mutants.current_dir(root).output();
    let output = output.expect("`cargo install cargo-mutants` first");
    let errors = String::from_utf8_lossy(&output.stderr);
    let all: Vec<Listed> = serde_json::from_slice(&output.stdout)
        .unwrap_or_else(|error| panic!("no list of defects ({error}): {errors}"));
    let planted = |listed: &Listed| {
        matches!(
            listed.genre.as_str(),
            "FnValue" | "BinaryOperator" | "UnaryOperator"
        ) && !listed.file.contains("test")
    };
    let mut seen = BTreeSet::new();
    // One for each place: what differs most from what stands there comes first.
    let all: Vec<Listed> = (all.into_iter().filter(planted))
        .filter(|listed| seen.insert((listed.file.clone(), listed.span.start)))
        .collect();
    let index = crate::AREAS
        .iter()
        .position(|other| other.name == area.name);
    let first = 1_000 * (index.expect("one of them") as u32 + 1);
    let count = area.defects.min(all.len());
    (0..count)
        .map(|at| Mutant {
            number: first + at as u32,
            area,
            listed: all[at * all.len() / count].clone(),
        })
        .collect()
}

/// Asks in each crate which defect is chosen; firmware has none.
const QUESTION: &str = r#"#[cfg(not(target_os = "none"))]
extern crate std;
/// Whether this defect is the chosen one.
#[cfg(not(target_os = "none"))]
pub(crate) fn is(number: u32) -> bool {
    static CHOSEN: std::sync::OnceLock<u32> = std::sync::OnceLock::new();
    let read = || std::env::var("ILTM_MUTANT").ok().and_then(|text| text.parse().ok());
    *CHOSEN.get_or_init(|| read().unwrap_or(0)) == number
}
/// Nothing is chosen.
#[cfg(target_os = "none")]
pub(crate) fn is(_: u32) -> bool {
    false
}
"#;

/// Plants defects in a copy of the workspace; numbers of those that are in it. A constant has no
/// place for a question.
pub fn plant(copy: &Path, mutants: &[&Mutant]) -> BTreeSet<u32> {
    let mut planted = BTreeSet::new();
    let mut files: BTreeMap<&str, Vec<&Mutant>> = BTreeMap::new();
    for mutant in mutants {
        files.entry(&mutant.listed.file).or_default().push(mutant);
    }
    let mut crates = BTreeSet::new();
    for (file, mutants) in files {
        let text = fs::read_to_string(copy.join(file)).expect("a file of the copy");
        let mut syntax = syn::parse_file(&text).expect("Rust");
        let mut planting = Planting {
            mutants: &mutants,
            planted: &mut planted,
        };
        planting.visit_file_mut(&mut syntax);
        fs::write(copy.join(file), prettyplease::unparse(&syntax)).expect("writable");
        let (source, _) = file.split_once("/src/").expect("a crate's source");
        crates.insert(format!("{source}/src"));
    }
    for source in crates {
        let source = copy.join(source);
        fs::write(source.join("mutant.rs"), QUESTION).expect("writable");
        let lib = source.join("lib.rs");
        let text = fs::read_to_string(&lib).expect("a library");
        fs::write(lib, text + "\nmod mutant;\n").expect("writable");
    }
    planted
}

/// Numbers of the defects nearest to these places of the copy, each a file and a line.
pub fn blame(copy: &Path, errors: &[(String, usize)]) -> BTreeSet<u32> {
    let nearest = |(file, line): &(String, usize)| {
        let text = fs::read_to_string(copy.join(file)).ok()?;
        let lines: Vec<&str> = text.lines().collect();
        let number = |line: &str| {
            let (_, rest) = line.split_once("mutant::is(")?;
            rest.split("u32").next()?.parse().ok()
        };
        let around = (0..8).flat_map(|off| [line.checked_sub(off + 1), Some(line + off)]);
        around.flatten().find_map(|at| number(lines.get(at)?))
    };
    errors.iter().filter_map(nearest).collect()
}

struct Planting<'m> {
    mutants: &'m [&'m Mutant],
    planted: &'m mut BTreeSet<u32>,
}

impl<'m> Planting<'m> {
    fn at(&self, genre: &str, span: proc_macro2::Span) -> Option<&'m Mutant> {
        let start = span.start();
        let place = Place {
            line: start.line,
            column: start.column + 1,
        };
        let mut mutants = self.mutants.iter().copied();
        mutants.find(|mutant| mutant.listed.genre == genre && mutant.listed.span.start == place)
    }

    fn body(&mut self, block: &mut Block) {
        let (start, end) = (block.span().start(), block.span().end());
        let inside = |mutant: &&&Mutant| {
            let Span {
                start: from,
                end: to,
            } = mutant.listed.span;
            mutant.listed.genre == "FnValue"
                && (from.line, from.column) >= (start.line, start.column + 1)
                && (to.line, to.column) <= (end.line, end.column + 1)
                // Not of a function inside.
                && block.stmts.first().is_none_or(|first| {
                    let first = first.span().start();
                    (from.line, from.column) <= (first.line, first.column + 1)
                })
        };
        let Some(mutant) = self.mutants.iter().find(inside) else {
            return;
        };
        let number = mutant.number;
        let Ok(value) = syn::parse_str::<Expr>(&mutant.listed.replacement) else {
            return;
        };
        self.planted.insert(number);
        block.stmts.insert(
            0,
            parse_quote!(if crate::mutant::is(#number) { return #value; }),
        );
    }
}

impl VisitMut for Planting<'_> {
    fn visit_item_const_mut(&mut self, _: &mut ItemConst) {}

    fn visit_item_static_mut(&mut self, _: &mut ItemStatic) {}

    fn visit_impl_item_const_mut(&mut self, _: &mut syn::ImplItemConst) {}

    fn visit_type_mut(&mut self, _: &mut syn::Type) {}

    fn visit_item_mod_mut(&mut self, module: &mut ItemMod) {
        if module.ident != "tests" {
            visit_mut::visit_item_mod_mut(self, module);
        }
    }

    fn visit_item_fn_mut(&mut self, function: &mut ItemFn) {
        if function.sig.constness.is_none() {
            self.body(&mut function.block);
            visit_mut::visit_item_fn_mut(self, function);
        }
    }

    fn visit_impl_item_fn_mut(&mut self, function: &mut ImplItemFn) {
        if function.sig.constness.is_none() {
            self.body(&mut function.block);
            visit_mut::visit_impl_item_fn_mut(self, function);
        }
    }

    fn visit_expr_mut(&mut self, expression: &mut Expr) {
        let found = match expression {
            Expr::Binary(binary) => self.at("BinaryOperator", binary.op.span()),
            Expr::Unary(unary) => self.at("UnaryOperator", unary.op.span()),
            _ => None,
        };
        let found = found.map(|mutant| (mutant.number, mutant.listed.replacement.clone()));
        visit_mut::visit_expr_mut(self, expression);
        let Some((number, replacement)) = found else {
            return;
        };
        let other: Expr = match expression {
            Expr::Binary(binary) => {
                let (left, right) = (&binary.left, &binary.right);
                let operator: proc_macro2::TokenStream = replacement.parse().expect("an operator");
                let Ok(other) = syn::parse2(quote!(#left #operator #right)) else {
                    return;
                };
                other
            }
            Expr::Unary(unary) => *unary.expr.clone(),
            _ => return,
        };
        self.planted.insert(number);
        *expression = parse_quote!((if crate::mutant::is(#number) { #other } else { #expression }));
    }
}
