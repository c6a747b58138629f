//! No circles of files: within a crate, what uses stands above what is used. And no arrow back in the
//! library and in its experiments: a room uses only those that its `lib.rs` names before it.
//!
//! An arrow goes from a file to the one that defines what it names, by `use` or by path; re-exports
//! are followed to the definition and are no arrows themselves. Tests are left out.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

use syn::visit::{self, Visit};
use syn::{Item, UseTree};

/// The path of a module or an item.
type Names = Vec<String>;

/// A module of a crate.
#[derive(Default)]
struct Module {
    file: PathBuf,
    definitions: BTreeSet<String>,
    /// what a name that is imported here means
    imports: BTreeMap<String, Names>,
    /// `use …::*`
    globs: Vec<Names>,
    /// what is named here, re-exports left out
    named: Vec<Names>,
}

/// All modules of a crate.
#[derive(Default)]
struct Crate(BTreeMap<Names, Module>);

impl Crate {
    fn read(source: &Path) -> Self {
        let mut modules = Self::default();
        let roots = ["lib.rs", "main.rs"].map(|name| source.join(name));
        if let Some(root) = roots.iter().find(|root| root.is_file()) {
            modules.file(root, source, vec![]);
        }
        modules
    }

    /// A module in a file of its own; its children are in `folder`.
    fn file(&mut self, file: &Path, folder: &Path, at: Names) {
        let text = fs::read_to_string(file).unwrap_or_else(|e| panic!("{}: {e}", file.display()));
        let parsed = syn::parse_file(&text).unwrap_or_else(|e| panic!("{}: {e}", file.display()));
        self.items(&parsed.items, file, folder, at);
    }

    fn items(&mut self, items: &[Item], file: &Path, folder: &Path, at: Names) {
        let mut module = Module {
            file: file.to_owned(),
            ..Module::default()
        };
        for item in items.iter().filter(|item| !is_test(item)) {
            if let Some(name) = defined(item) {
                module.definitions.insert(name);
            }
            match item {
                Item::Use(item) => {
                    let is_door = !matches!(item.vis, syn::Visibility::Inherited);
                    module.take(&item.tree, &mut vec![], is_door);
                }
                Item::Mod(child) => {
                    let name = child.ident.to_string();
                    let at = [&at[..], std::slice::from_ref(&name)].concat();
                    let (single, within) = (folder.join(format!("{name}.rs")), folder.join(&name));
                    match &child.content {
                        Some((_, items)) => self.items(items, file, &within, at),
                        None if single.is_file() => self.file(&single, &within, at),
                        None => self.file(&within.join("mod.rs"), &within, at),
                    }
                }
                other => Paths(&mut module.named).visit_item(other),
            }
        }
        self.0.insert(at, module);
    }

    /// A path that is written in a module, from the root of the crate; none for another crate's.
    fn absolute(&self, at: &[String], path: &[String]) -> Option<Names> {
        let (first, rest) = path.split_first()?;
        let module = self.0.get(at)?;
        match first.as_str() {
            "crate" => Some(rest.to_vec()),
            "self" => Some([at, rest].concat()),
            "super" => {
                let (_, parent) = at.split_last()?;
                match rest.first().is_some_and(|name| name == "super") {
                    true => self.absolute(parent, rest),
                    false => Some([parent, rest].concat()),
                }
            }
            name => {
                let child = [at, std::slice::from_ref(first)].concat();
                if self.0.contains_key(&child) {
                    return Some([at, path].concat());
                }
                let import = module.imports.get(name).filter(|i| i[0] != *name)?;
                Some([self.absolute(at, import)?, rest.to_vec()].concat())
            }
        }
    }

    /// The module that defines what stands at a path.
    fn definer(&self, path: &[String], depth: usize) -> Option<&Module> {
        let length = (0..=path.len())
            .rev()
            .find(|&k| self.0.contains_key(&path[..k]))?;
        let (at, rest) = path.split_at(length);
        let module = &self.0[at];
        let Some((name, rest)) = rest.split_first() else {
            return Some(module);
        };
        if name == "*" || module.definitions.contains(name) || depth > 16 {
            return Some(module);
        }
        if let Some(import) = module.imports.get(name) {
            let target = self.absolute(at, import)?;
            return self.definer(&[&target[..], rest].concat(), depth + 1);
        }
        let opened = module.globs.iter().filter_map(|glob| {
            let target = self.absolute(at, glob)?;
            let found = self.definer(
                &[&target[..], std::slice::from_ref(name)].concat(),
                depth + 1,
            )?;
            found.definitions.contains(name).then_some(found)
        });
        opened.into_iter().next().or(Some(module))
    }

    /// From each file to those that it uses.
    fn arrows(&self) -> BTreeMap<&Path, BTreeSet<&Path>> {
        let mut arrows: BTreeMap<&Path, BTreeSet<&Path>> = BTreeMap::new();
        for (at, module) in &self.0 {
            let from = arrows.entry(&module.file).or_default();
            let paths = module.named.iter().filter_map(|p| self.absolute(at, p));
            let used = paths.filter_map(|path| Some(&*self.definer(&path, 0)?.file));
            from.extend(used.filter(|file| *file != module.file));
        }
        arrows
    }
}

impl Module {
    fn take(&mut self, tree: &UseTree, before: &mut Names, is_door: bool) {
        match tree {
            UseTree::Path(path) => {
                before.push(path.ident.to_string());
                self.take(&path.tree, before, is_door);
                before.pop();
            }
            UseTree::Group(group) => {
                for tree in &group.items {
                    self.take(tree, before, is_door);
                }
            }
            UseTree::Glob(_) => {
                self.globs.push(before.clone());
                self.name([&before[..], &["*".to_owned()]].concat(), is_door);
            }
            UseTree::Name(name) => self.import(&name.ident, &name.ident, before, is_door),
            UseTree::Rename(name) => self.import(&name.ident, &name.rename, before, is_door),
        }
    }

    fn import(&mut self, what: &syn::Ident, name: &syn::Ident, before: &Names, is_door: bool) {
        let (what, mut name) = (what.to_string(), name.to_string());
        let mut path = before.clone();
        match what == "self" {
            true if name == "self" => name = before.last().cloned().unwrap_or_default(),
            true => {}
            false => path.push(what),
        }
        self.imports.insert(name, path.clone());
        self.name(path, is_door);
    }

    fn name(&mut self, path: Names, is_door: bool) {
        if !is_door {
            self.named.push(path);
        }
    }
}

/// Gathers paths of two names and more.
struct Paths<'a>(&'a mut Vec<Names>);

impl Visit<'_> for Paths<'_> {
    fn visit_path(&mut self, path: &syn::Path) {
        if path.segments.len() > 1 {
            let names = path.segments.iter().map(|s| s.ident.to_string());
            self.0.push(names.collect());
        }
        visit::visit_path(self, path);
    }

    /// What a macro is given is not parsed: everything in it that reads like a path counts.
    fn visit_macro(&mut self, call: &syn::Macro) {
        let text = call.tokens.to_string().replace(" :: ", "::");
        let words = text.split(|c: char| !(c.is_alphanumeric() || c == '_' || c == ':'));
        for word in words.map(|word| word.trim_matches(':')) {
            if word.contains("::") {
                self.0.push(word.split("::").map(str::to_owned).collect());
            }
        }
    }
}

fn defined(item: &Item) -> Option<String> {
    let name = match item {
        Item::Const(item) => &item.ident,
        Item::Enum(item) => &item.ident,
        Item::Fn(item) => &item.sig.ident,
        Item::Macro(item) => item.ident.as_ref()?,
        Item::Static(item) => &item.ident,
        Item::Struct(item) => &item.ident,
        Item::Trait(item) => &item.ident,
        Item::Type(item) => &item.ident,
        Item::Union(item) => &item.ident,
        _ => return None,
    };
    Some(name.to_string())
}

/// Whether an item is compiled for tests only.
fn is_test(item: &Item) -> bool {
    let attributes = match item {
        Item::Fn(item) => &item.attrs,
        Item::Impl(item) => &item.attrs,
        Item::Mod(item) => &item.attrs,
        Item::Struct(item) => &item.attrs,
        Item::Use(item) => &item.attrs,
        _ => return false,
    };
    attributes.iter().any(|attribute| {
        let condition = attribute.meta.require_list();
        attribute.path().is_ident("cfg")
            && condition.is_ok_and(|list| list.tokens.to_string() == "test")
    })
}

/// The files from which arrows lead back to themselves.
fn on_circles<'a>(arrows: &BTreeMap<&'a Path, BTreeSet<&'a Path>>) -> BTreeSet<&'a Path> {
    let leads_back = |start: &Path| {
        let mut seen = BTreeSet::new();
        let mut open = vec![start];
        while let Some(file) = open.pop() {
            open.extend(arrows[file].iter().filter(|used| seen.insert(**used)));
        }
        seen.contains(start)
    };
    let files = arrows.keys().copied();
    files.filter(|file| leads_back(file)).collect()
}

#[test]
fn no_files_use_each_other_in_a_circle() {
    let crates = Path::new(env!("CARGO_MANIFEST_DIR")).join("../crates");
    let mut found = String::new();
    let mut files = 0;
    for folder in fs::read_dir(&crates).expect("the workspace has its crates") {
        let source = folder.expect("a folder can be read").path().join("src");
        let modules = Crate::read(&source);
        let arrows = modules.arrows();
        files += arrows.len();
        let circular = on_circles(&arrows);
        for file in &circular {
            let used = arrows[file].intersection(&circular);
            let short = |file: &Path| {
                file.strip_prefix(&crates)
                    .unwrap_or(file)
                    .display()
                    .to_string()
            };
            let used: Vec<String> = used.map(|file| short(file)).collect();
            found += &format!("{} uses {}\n", short(file), used.join(", "));
        }
    }
    assert!(files > 100, "only {files} files were read");
    assert!(
        found.is_empty(),
        "files that use each other in a circle; what both need belongs below them:\n{found}"
    );
}

/// The rooms of a crate, in the order of its `lib.rs`.
fn rooms(source: &Path) -> Vec<String> {
    let text = fs::read_to_string(source.join("lib.rs")).expect("the crate has its front page");
    let parsed = syn::parse_file(&text).expect("it is Rust");
    let modules = parsed.items.iter().filter_map(|item| match item {
        Item::Mod(room) => Some(room.ident.to_string()),
        _ => None,
    });
    modules.collect()
}

#[test]
fn no_room_uses_one_above_it() {
    for name in ["lynkeus-experiment", "lynkeus"] {
        let crates = Path::new(env!("CARGO_MANIFEST_DIR")).join("../crates");
        let back = arrows_back(&crates.join(name).join("src"));
        assert!(
            back.is_empty(),
            "a room of {name} uses one that `lib.rs` names after it; what both need belongs below:\n{back}"
        );
    }
}

fn arrows_back(source: &Path) -> String {
    let rooms = rooms(source);
    let room = |file: &Path| {
        let inside = file.strip_prefix(source).ok()?;
        let first = inside.components().next()?.as_os_str().to_str()?;
        let name = first.strip_suffix(".rs").unwrap_or(first);
        rooms.iter().position(|room| room == name)
    };
    let modules = Crate::read(source);
    let mut back = String::new();
    for (file, used) in modules.arrows() {
        for other in used {
            if let (Some(own), Some(above)) = (room(file), room(other))
                && above > own
            {
                let (file, other) = (file.display(), other.display());
                back += &format!("{file} uses {other}\n");
            }
        }
    }
    assert!(rooms.len() > 7, "only {rooms:?} were found");
    back
}

/// Two files that name each other through a re-export are a circle, tests are none.
#[test]
fn a_circle_is_seen_through_re_exports() {
    let folder = std::env::temp_dir().join(format!("circles-{}", std::process::id()));
    fs::create_dir_all(&folder).expect("a folder can be made");
    let write =
        |name: &str, text: &str| fs::write(folder.join(name), text).expect("a file can be written");
    write("lib.rs", "mod a; mod b; pub use a::A; pub use b::B;");
    write("a.rs", "use crate::B; pub struct A(B);");
    write(
        "b.rs",
        "pub struct B; #[cfg(test)] mod tests { use crate::A; }",
    );
    let circular = || on_circles(&Crate::read(&folder).arrows()).len();
    assert_eq!(circular(), 0);
    write(
        "b.rs",
        "pub struct B; impl B { fn a() -> Vec<crate::A> { vec![] } }",
    );
    assert_eq!(circular(), 2);
    write(
        "b.rs",
        "pub struct B; fn b() { drop(vec![crate::a::A(B)]); }",
    );
    assert_eq!(circular(), 2);
    fs::remove_dir_all(&folder).expect("a folder can be removed");
}
