//! Error types, read from the source: their words are where they are made, and nowhere else.

use std::collections::HashMap;
use std::fs;
use std::io;
use std::path::PathBuf;
use syn::{Arm, Attribute, Expr, ImplItem, Item, ItemEnum, ItemImpl, Lit, Meta, Pat};

/// An error type.
pub(super) struct ErrorType {
    pub(super) name: String,
    pub(super) about: String,
    pub(super) cases: Vec<Case>,
}

/// One of its cases.
pub(super) struct Case {
    pub(super) name: String,
    pub(super) about: String,
    /// What is said, with the names of what is filled in.
    pub(super) message: Option<String>,
    pub(super) next_step: Option<String>,
}

/// Public error types in these files, ordered by name.
pub(super) fn in_files(files: &[PathBuf]) -> io::Result<Vec<ErrorType>> {
    let mut found = Vec::new();
    let mut advice = HashMap::new();
    for path in files {
        let text = fs::read_to_string(path)?;
        let file = syn::parse_file(&text).map_err(|error| {
            io::Error::new(
                io::ErrorKind::InvalidData,
                format!("{}: {error}", path.display()),
            )
        })?;
        for item in file.items {
            match item {
                Item::Enum(item) if is_error(&item) => found.push(error_type(&item)),
                Item::Impl(item) => next_steps(&item, &mut advice),
                _ => {}
            }
        }
    }
    for error in &mut found {
        for case in &mut error.cases {
            case.next_step = advice
                .get(&(error.name.clone(), case.name.clone()))
                .cloned();
        }
    }
    found.sort_by(|a, b| a.name.cmp(&b.name));
    Ok(found)
}

/// Public, and by its name or its derives an error.
fn is_error(item: &ItemEnum) -> bool {
    let public = matches!(item.vis, syn::Visibility::Public(_));
    let name = item.ident.to_string();
    public && (name.ends_with("Error") || ["Rejected", "Refusal"].contains(&name.as_str()))
}

fn error_type(item: &ItemEnum) -> ErrorType {
    let case = |variant: &syn::Variant| Case {
        name: variant.ident.to_string(),
        about: documentation(&variant.attrs),
        message: message(&variant.attrs),
        next_step: None,
    };
    ErrorType {
        name: item.ident.to_string(),
        about: documentation(&item.attrs),
        cases: item.variants.iter().map(case).collect(),
    }
}

/// The first paragraph of a doc comment, links as plain code.
fn documentation(attributes: &[Attribute]) -> String {
    let mut lines = Vec::new();
    for attribute in attributes {
        if let Meta::NameValue(pair) = &attribute.meta
            && pair.path.is_ident("doc")
            && let Some(line) = text(&pair.value)
        {
            lines.push(line.trim().to_owned());
        }
    }
    let first: Vec<String> = lines
        .into_iter()
        .take_while(|line| !line.is_empty())
        .collect();
    let mut plain = first.join(" ");
    // [`Name`](target) and [`Name`] lead nowhere on a page.
    while let Some(from) = plain.find("[`") {
        let Some(to) = plain[from..].find("`]").map(|at| from + at) else {
            break;
        };
        let name = plain[from + 1..=to].to_owned();
        let mut end = to + 2;
        if plain[end..].starts_with('(') {
            end += plain[end..].find(')').map_or(0, |at| at + 1);
        }
        plain.replace_range(from..end, &name);
    }
    plain
}

/// The first string of `#[error("...")]`.
fn message(attributes: &[Attribute]) -> Option<String> {
    let attribute = attributes.iter().find(|a| a.path().is_ident("error"))?;
    let Meta::List(list) = &attribute.meta else {
        return None;
    };
    let arguments = list
        .parse_args_with(syn::punctuated::Punctuated::<Expr, syn::Token![,]>::parse_terminated)
        .ok()?;
    let mut words = text(arguments.first()?)?;
    for argument in arguments.iter().skip(1) {
        words = words.replacen("{}", &format!("{{{}}}", named(argument)), 1);
    }
    let words = words.split_whitespace().collect::<Vec<_>>().join(" ");
    // A brace that is meant is written twice.
    Some(words.replace("{{", "{").replace("}}", "}"))
}

/// What an argument of a message is called: the name it is made from.
fn named(argument: &Expr) -> String {
    match argument {
        Expr::Path(path) => path
            .path
            .segments
            .last()
            .map_or_else(String::new, |last| last.ident.to_string()),
        Expr::MethodCall(call) => named(&call.receiver),
        Expr::Field(field) => named(&field.base),
        Expr::Reference(reference) => named(&reference.expr),
        Expr::Index(index) => named(&index.expr),
        Expr::Call(call) => call.args.first().map_or_else(String::new, named),
        _ => "...".to_owned(),
    }
}

fn text(expression: &Expr) -> Option<String> {
    match expression {
        Expr::Lit(literal) => match &literal.lit {
            Lit::Str(text) => Some(text.value()),
            _ => None,
        },
        Expr::Block(block) => match block.block.stmts.as_slice() {
            [syn::Stmt::Expr(inner, None)] => text(inner),
            _ => None,
        },
        _ => None,
    }
}

/// What `next_step` says of each case, where it is a plain sentence.
fn next_steps(item: &ItemImpl, advice: &mut HashMap<(String, String), String>) {
    let syn::Type::Path(of) = item.self_ty.as_ref() else {
        return;
    };
    let Some(name) = of.path.segments.last().map(|last| last.ident.to_string()) else {
        return;
    };
    for item in &item.items {
        let ImplItem::Fn(function) = item else {
            continue;
        };
        if function.sig.ident != "next_step" {
            continue;
        }
        for statement in &function.block.stmts {
            if let syn::Stmt::Expr(Expr::Match(choice), _) = statement {
                for arm in &choice.arms {
                    of_arm(arm, &name, advice);
                }
            }
        }
    }
}

fn of_arm(arm: &Arm, name: &str, advice: &mut HashMap<(String, String), String>) {
    let Some(sentence) = text(&arm.body) else {
        return;
    };
    let mut patterns = vec![&arm.pat];
    while let Some(pattern) = patterns.pop() {
        let path = match pattern {
            Pat::Or(either) => {
                patterns.extend(&either.cases);
                continue;
            }
            Pat::Struct(of) => &of.path,
            Pat::TupleStruct(of) => &of.path,
            Pat::Path(of) => &of.path,
            _ => continue,
        };
        if let Some(case) = path.segments.last() {
            let key = (name.to_owned(), case.ident.to_string());
            advice.insert(key, sentence.clone());
        }
    }
}
