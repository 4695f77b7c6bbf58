//! Files of a crate that import each other in a circle.

use std::collections::{BTreeMap, BTreeSet};

use crate::sources::{Source, sources};

/// A path of modules, from the root of the crate.
type Module = Vec<String>;

/// Which name of a module stands for which path: what it imports, for itself or for others.
type Names = BTreeMap<Module, BTreeMap<String, Module>>;

/// The groups of files each of which reaches all others by what it imports, sorted. A child may look up to the modules it
/// lives in: that is what they are for.
pub fn circles(folder: &str) -> Vec<Vec<String>> {
    let files: BTreeMap<Module, Source> = sources(folder)
        .into_iter()
        .filter(|source| !source.is_test())
        .filter_map(|source| Some((module_of(&source.path, folder)?, source)))
        .collect();
    let code: BTreeMap<&Module, String> = files.iter().map(|(module, file)| (module, file.code())).collect();
    let mut names = Names::new();
    for (module, code) in &code {
        let imported = imports(code).into_iter().filter_map(|path| {
            let name = path.last()?.clone();
            Some((name, absolute(&path, module, &files)?))
        });
        names.insert((*module).clone(), imported.collect());
    }
    let edges: BTreeMap<&Module, BTreeSet<Module>> = code
        .iter()
        .map(|(module, code)| {
            let paths = paths(code).into_iter().chain(imports(code));
            let targets = paths.filter_map(|path| absolute(&path, module, &files));
            let targets = targets.map(|path| declared_in(&path, &files, &names));
            (
                *module,
                targets.filter(|target| files.contains_key(target) && !module.starts_with(target)).collect(),
            )
        })
        .collect();
    let reached: BTreeMap<&Module, BTreeSet<Module>> =
        files.keys().map(|module| (module, reach(module, &edges))).collect();
    let circle = |module: &Module| -> Vec<String> {
        let others = reached[module].iter().filter(|other| reached[*other].contains(module));
        others.map(|other| files[other].path.clone()).collect()
    };
    let circles: BTreeSet<Vec<String>> = files.keys().map(circle).filter(|files| files.len() > 1).collect();
    circles.into_iter().collect()
}

/// `src/a/mod.rs` and `src/a.rs` are the module `a`; the root is `[]`. A program's `main.rs` is none of the library's.
fn module_of(path: &str, folder: &str) -> Option<Module> {
    let path = path.strip_prefix(folder)?.trim_start_matches('/').strip_suffix(".rs")?;
    let mut module: Module = path.split('/').map(str::to_owned).collect();
    match module.last().map(String::as_str) {
        Some("main") if module.len() == 1 => return None,
        Some("lib") if module.len() == 1 => module.clear(),
        Some("mod") => drop(module.pop()),
        _ => {}
    }
    Some(module)
}

/// All modules that can be reached from one.
fn reach(from: &Module, edges: &BTreeMap<&Module, BTreeSet<Module>>) -> BTreeSet<Module> {
    let mut reached = BTreeSet::new();
    let mut next = vec![from.clone()];
    while let Some(module) = next.pop() {
        for target in edges.get(&module).into_iter().flatten() {
            if reached.insert(target.clone()) {
                next.push(target.clone());
            }
        }
    }
    reached
}

/// A path as written in a module, from the root of the crate; `None` for what belongs to another crate.
fn absolute(path: &[String], module: &Module, files: &BTreeMap<Module, Source>) -> Option<Module> {
    let mut place = module.clone();
    let mut rest = path;
    match rest.first()?.as_str() {
        "crate" => (place, rest) = (Module::new(), &rest[1..]),
        "self" => rest = &rest[1..],
        "super" => {
            while rest.first().is_some_and(|part| part == "super") {
                place.pop();
                rest = &rest[1..];
            }
        }
        first => {
            place.push(first.to_owned());
            files.get(&place)?;
            place.pop();
        }
    }
    place.extend(rest.iter().cloned());
    Some(place)
}

/// The module whose file declares what an absolute path names, through as many re-exports as there are.
fn declared_in(path: &Module, files: &BTreeMap<Module, Source>, names: &Names) -> Module {
    let mut path = path.clone();
    // More re-exports in a row than this would be a circle of their own.
    for _ in 0..10 {
        let longest = (0..=path.len()).rev().find(|n| files.contains_key(&path[..*n])).unwrap_or(0);
        let module: Module = path[..longest].to_vec();
        let Some(target) = path.get(longest).and_then(|name| names.get(&module)?.get(name)) else {
            return module;
        };
        path = target.clone();
    }
    path
}

/// Every path in the code that begins with `crate`, `self` or `super`, groups in braces spelt out.
fn paths(code: &str) -> Vec<Module> {
    let mut found = Vec::new();
    for start in ["crate::", "super::", "self::"] {
        for (at, _) in code.match_indices(start) {
            let before = code[..at].chars().next_back();
            if before.is_none_or(|c| !c.is_alphanumeric() && c != '_' && c != ':' && c != '$') {
                spell_out(&code[at..], &Module::new(), &mut found);
            }
        }
    }
    found
}

/// The paths of all `use` items.
fn imports(code: &str) -> Vec<Module> {
    let mut found = Vec::new();
    let mut from = 0;
    while let Some(at) = code[from..].find("use ").map(|at| at + from) {
        from = at + 4;
        let begins = code[..at].lines().next_back().unwrap_or_default();
        if matches!(begins.trim(), "" | "pub" | "pub(crate)" | "pub(super)")
            || begins.trim().starts_with("pub(in")
        {
            spell_out(&code[from..], &Module::new(), &mut found);
        }
    }
    found
}

/// Adds the paths a text begins with, each after `prefix`; returns how much of the text they take.
fn spell_out(text: &str, prefix: &Module, found: &mut Vec<Module>) -> usize {
    let mut path = prefix.clone();
    let mut at = 0;
    loop {
        at += text[at..].len() - text[at..].trim_start().len();
        let rest = &text[at..];
        if rest.starts_with('{') {
            at += 1;
            loop {
                at += spell_out(&text[at..], &path, found);
                at += text[at..].len() - text[at..].trim_start().len();
                match text[at..].chars().next() {
                    Some(',') => at += 1,
                    Some('}') => return at + 1,
                    _ => return at,
                }
            }
        }
        let name = rest.find(|c: char| !c.is_alphanumeric() && c != '_').unwrap_or(rest.len());
        if name == 0 {
            break;
        }
        path.push(rest[..name].to_owned());
        at += name;
        match text[at..].strip_prefix("::") {
            Some(more) if !more.starts_with('<') => at += 2,
            _ => break,
        }
    }
    let named = path.len() > prefix.len();
    if path.len() > 1 && path.last().is_some_and(|last| last == "self") {
        path.pop();
    }
    // `as` another name: nobody looks a path up by it here.
    let renamed = text[at..].trim_start();
    if renamed.starts_with("as ") {
        at += text[at..].find([',', ';', '}']).unwrap_or(0);
    }
    if named {
        found.push(path);
    }
    at
}

#[cfg(test)]
mod tests {
    use super::*;

    fn spelt(code: &str) -> Vec<String> {
        imports(code).into_iter().map(|path| path.join("::")).collect()
    }

    #[test]
    fn groups_are_spelt_out() {
        assert_eq!(
            spelt("pub use crate::a::{self, B, c::{D, E as F}};\nlet reuse = 1;"),
            ["crate::a", "crate::a::B", "crate::a::c::D", "crate::a::c::E"]
        );
    }
}
