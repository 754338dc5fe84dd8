//! Imports among files: no circle of more than two, and no type whose methods are spread over many files.
//!
//! A file imports from the file that defines what it names, however the name is passed on. A part of a module may use what the module's
//! own file defines (`problem/pass.rs` the `Problem` of `problem.rs`), which counts as no import.

use super::{code, files, place};
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

type Name = Vec<String>;

/// The names of a path.
fn names(text: &str) -> impl Iterator<Item = String> {
    text.split("::").map(|one| one.trim().to_owned()).filter(|one| !one.is_empty())
}

/// The paths of an import: `a::b` and `a::c` of `a::{b, c}`, with the name by which each is known.
fn paths(prefix: &[String], text: &str, found: &mut Vec<(Name, String)>) {
    let text = text.trim();
    let Some((before, list)) = text.split_once('{') else {
        let (path, other) = text.split_once(" as ").unwrap_or((text, ""));
        let mut path: Name = prefix.iter().cloned().chain(names(path)).collect();
        if path.last().is_some_and(|last| last == "self") {
            path.pop();
        }
        if let Some(last) = path.last().cloned() {
            found.push((path, if other.is_empty() { last } else { other.trim().to_owned() }));
        }
        return;
    };
    let prefix: Name = prefix.iter().cloned().chain(names(before)).collect();
    let (mut depth, mut item) = (0, String::new());
    for c in list[..list.rfind('}').unwrap_or(list.len())].chars().chain([',']) {
        depth += i32::from(c == '{') - i32::from(c == '}');
        if c == ',' && depth == 0 {
            paths(&prefix, &item, found);
            item.clear();
        } else {
            item.push(c);
        }
    }
}

/// The files of a crate, by their places, with their code.
struct Files(BTreeMap<Name, String>);

impl Files {
    /// A path as one from the crate's root, as a file names it; `None` if it leads to another crate.
    fn absolute(&self, file: &Name, path: &[String]) -> Option<Name> {
        let above = path.iter().take_while(|name| *name == "super").count();
        match path.first()?.as_str() {
            "crate" => Some(path[1..].to_vec()),
            "self" => Some([file, &path[1..]].concat()),
            "super" => Some([&file[..file.len().checked_sub(above)?], &path[above..]].concat()),
            first => {
                let part = [&file[..], &[first.to_owned()]].concat();
                self.0.contains_key(&part).then(|| [file, path].concat())
            }
        }
    }

    /// The imports of a file: their paths, by the names by which they are known.
    fn imports(&self, file: &Name) -> BTreeMap<String, Name> {
        let mut found = vec![];
        for statement in self.0[file].split(';') {
            let Some(at) = statement.rfind("use ") else { continue };
            let before = statement[..at].chars().next_back();
            if before.is_none_or(char::is_whitespace) {
                paths(&[], &statement[at + 4..], &mut found);
            }
        }
        let mut imports = BTreeMap::new();
        for (path, name) in found {
            let Some(mut path) = self.absolute(file, &path) else { continue };
            if name != "*" {
                imports.insert(name, path);
                continue;
            }
            path.pop();
            // What the other file names, this one names by it.
            if self.0.contains_key(&path) {
                imports.extend(self.imports(&path));
            }
        }
        imports
    }

    /// The file that defines what a path names; `None` of a module, of which what is used names its own path.
    fn definer(&self, imports: &BTreeMap<Name, BTreeMap<String, Name>>, path: &[String], depth: usize) -> Option<Name> {
        let length = (1..=path.len()).rev().find(|&length| self.0.contains_key(&path[..length]))?;
        if length == path.len() {
            return None;
        }
        let (file, rest) = path.split_at(length);
        match imports[file].get(&rest[0]).filter(|other| *other != path) {
            Some(other) if depth < 8 => self.definer(imports, &[&other[..], &rest[1..]].concat(), depth + 1),
            _ => Some(file.to_vec()),
        }
    }

    /// From which files each imports.
    fn edges(&self) -> BTreeMap<Name, BTreeSet<Name>> {
        let imports: BTreeMap<Name, _> = self.0.keys().map(|file| (file.clone(), self.imports(file))).collect();
        let edges = |file: &Name| {
            let mut named: Vec<Name> = imports[file].values().cloned().collect();
            // Paths in the code.
            let is_name = |c: char| c.is_alphanumeric() || c == '_' || c == ':';
            for word in self.0[file].split(|c| !is_name(c)).filter(|word| word.contains("::")) {
                let path: Name = word.split("::").map(str::to_owned).collect();
                named.extend(match imports[file].get(&path[0]) {
                    Some(known) => Some([&known[..], &path[1..]].concat()),
                    None => self.absolute(file, &path),
                });
            }
            let from = named.iter().filter_map(|path| self.definer(&imports, path, 0));
            (file.clone(), from.filter(|from| !file.starts_with(from)).collect())
        };
        self.0.keys().map(edges).collect()
    }
}

/// The circles of imports: sets of files each of which leads to all others.
fn circles(edges: &BTreeMap<Name, BTreeSet<Name>>) -> Vec<BTreeSet<&Name>> {
    let reached = |from| -> BTreeSet<&Name> {
        let (mut found, mut open) = (BTreeSet::new(), vec![from]);
        while let Some(file) = open.pop() {
            open.extend(edges.get(file).into_iter().flatten().filter(|next| found.insert(*next)));
        }
        found
    };
    let reached: BTreeMap<&Name, BTreeSet<&Name>> = edges.keys().map(|file| (file, reached(file))).collect();
    let mut circles = BTreeSet::new();
    for (file, all) in &reached {
        circles.insert(all.iter().copied().filter(|other| reached[*other].contains(file)).collect());
    }
    circles.into_iter().collect()
}

fn library() -> Files {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut found = vec![];
    files(&root, &mut found);
    let read = |file: &std::path::PathBuf| (place(&root, file), code(&std::fs::read_to_string(file).unwrap()));
    let inside = |(place, _): &(Name, String)| place != &["lib"] && !place.contains(&"tests".to_owned());
    Files(found.iter().map(read).filter(inside).collect())
}

#[test]
fn no_circle_of_more_than_two_files() {
    let edges = library().edges();
    assert!(edges.values().map(BTreeSet::len).sum::<usize>() > 1_000, "imports are not seen");
    let large: Vec<String> = circles(&edges)
        .iter()
        .filter(|circle| circle.len() > 2)
        .map(|circle| circle.iter().map(|file| file.join("/")).collect::<Vec<_>>().join(", "))
        .collect();
    assert!(large.is_empty(), "{}", large.join("\n"));
}

/// Through a name that is passed on, a path in the code, all names of another file, and a part that uses its module's own file, which is none.
#[test]
fn circles_are_seen() {
    let files = |all: &[(&str, &str)]| {
        let place = |file: &str| file.split('/').map(str::to_owned).collect();
        Files(all.iter().map(|(file, text)| (place(file), (*text).to_owned())).collect())
    };
    let count = |all: &[(&str, &str)]| circles(&files(all).edges()).iter().map(BTreeSet::len).max().unwrap_or(0);
    let passed = [("m", "pub use a::A; pub use b::B;"), ("m/a", "use super::B; struct A;"), ("m/b", "struct B;")];
    assert_eq!(count(&passed), 0);
    let back =
        [passed[0], passed[1], ("m/b", "struct B; fn f() { crate::m::c::g() }"), ("m/c", "use crate::m::{A, a::X};")];
    assert_eq!(count(&back), 3);
    assert_eq!(count(&[("m", "use a::A; struct M;"), ("m/a", "use super::M; struct A;")]), 0);
    let all = [
        ("m", "use b::B;"),
        ("m/a", "use super::*; struct A;"),
        ("m/b", "use crate::m::c::C; struct B;"),
        ("m/c", "use crate::m::a::A; struct C;"),
    ];
    assert_eq!(count(&all), 3);
}

/// Types of the verdict whose methods stand in more than three files.
#[test]
fn methods_of_the_verdict_stand_together() {
    let mut files_of: BTreeMap<String, BTreeSet<Name>> = BTreeMap::new();
    for (file, code) in
        library().0.into_iter().filter(|(file, _)| ["judge", "covariance", "residuals"].contains(&&*file[0]))
    {
        for line in code.lines().filter(|line| line.starts_with("impl") && !line.contains(" for ")) {
            let rest = line.trim_start_matches("impl");
            let rest = if rest.starts_with('<') { rest.split_once("> ").map_or("", |(_, rest)| rest) } else { rest };
            let name = rest.trim().chars().take_while(|c| c.is_alphanumeric()).collect();
            files_of.entry(name).or_default().insert(file.clone());
        }
    }
    assert!(files_of.contains_key("Evidence"), "{:?}", files_of.keys());
    let spread: Vec<_> = files_of.iter().filter(|(_, files)| files.len() > 3).collect();
    assert!(spread.is_empty(), "{spread:?}");
}
