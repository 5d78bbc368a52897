//! The public API of each library, as a list in docs/api: what changes there changes for whoever depends on us.
//!
//! `SCRNN_UPDATE_API=1 cargo test -p scrnn-checks --test public_api` writes the lists anew.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use quote::ToTokens;
use syn::{Fields, ImplItem, Item, TraitItem, UseTree, Visibility};

/// The libraries, by the folder in crates/ and the name that users write.
const LIBRARIES: [(&str, &str); 9] = [
    ("scrnn", "scrnn"),
    ("data", "scrnn_data"),
    ("sim", "scrnn_sim"),
    ("tasks", "scrnn_tasks"),
    ("run", "scrnn_run"),
    ("report", "scrnn_report"),
    ("pages", "scrnn_pages"),
    ("sweep", "scrnn_sweep"),
    ("reproduce", "scrnn_reproduce"),
];

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

/// Collects what a library shows.
struct Lister {
    lines: Vec<String>,
}

/// Tokens as a line: one space between them, none where nobody writes one.
fn line(tokens: &impl ToTokens) -> String {
    let mut text = tokens.to_token_stream().to_string();
    for (from, to) in [
        (" :: ", "::"),
        (":: ", "::"),
        (" < ", "<"),
        ("< ", "<"),
        (" >", ">"),
        (" ,", ","),
        ("& ", "&"),
        (" (", "("),
        ("( ", "("),
        (" )", ")"),
        ("[ ", "["),
        (" ]", "]"),
        (" :", ":"),
        (" ;", ";"),
    ] {
        text = text.replace(from, to);
    }
    text
}

fn is_public(visibility: &Visibility) -> bool {
    matches!(visibility, Visibility::Public(_))
}

/// Whether an attribute hides the item from users.
fn is_hidden(attributes: &[syn::Attribute]) -> bool {
    attributes.iter().any(|attribute| {
        let text = line(attribute);
        text.contains("doc") && text.contains("hidden") || text.contains("cfg(test)")
    })
}

impl Lister {
    fn add(&mut self, place: &str, text: &str) {
        self.lines.push(format!("{place}: {text}"));
    }

    /// The items of a file or of a module in it.
    fn items(&mut self, items: &[Item], place: &str, folder: &Path, visible: bool) {
        for item in items {
            match item {
                Item::Mod(module) if !is_hidden(&module.attrs) => {
                    let visible = visible && is_public(&module.vis);
                    let inner = format!("{place}::{}", module.ident);
                    match &module.content {
                        Some((_, items)) => self.items(items, &inner, &folder.join(module.ident.to_string()), visible),
                        None => self.file(folder, &module.ident.to_string(), &inner, visible),
                    }
                }
                // What lies in a private module is shown where it is exported again; its methods belong to it.
                Item::Impl(block) => self.block(block, place),
                Item::Use(exported) if visible && is_public(&exported.vis) && !is_hidden(&exported.attrs) => {
                    self.exports(&exported.tree, place, String::new());
                }
                _ => self.item(item, place, visible),
            }
        }
    }

    /// The file of a module, beside or below its parent's.
    fn file(&mut self, folder: &Path, name: &str, place: &str, visible: bool) {
        let candidates = [folder.join(format!("{name}.rs")), folder.join(name).join("mod.rs")];
        let Some(path) = candidates.iter().find(|path| path.exists()) else { return };
        let text = std::fs::read_to_string(path).unwrap();
        let file = syn::parse_file(&text).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
        self.items(&file.items, place, &folder.join(name), visible);
    }

    fn item(&mut self, item: &Item, place: &str, visible: bool) {
        let shown = |visibility: &Visibility, attributes: &[syn::Attribute]| {
            visible && is_public(visibility) && !is_hidden(attributes)
        };
        match item {
            Item::Fn(function) if shown(&function.vis, &function.attrs) => self.add(place, &line(&function.sig)),
            Item::Const(it) if shown(&it.vis, &it.attrs) => {
                self.add(place, &format!("const {}: {}", it.ident, line(&it.ty)));
            }
            Item::Type(it) if shown(&it.vis, &it.attrs) => {
                self.add(place, &format!("type {} = {}", it.ident, line(&it.ty)));
            }
            Item::Struct(it) if is_public(&it.vis) && !is_hidden(&it.attrs) => {
                let open = if is_growing(&it.attrs) { " (non_exhaustive)" } else { "" };
                let of = format!("{place}::{}", it.ident);
                self.add(place, &format!("struct {}{}{open}", it.ident, line(&it.generics)));
                if let Fields::Named(fields) = &it.fields {
                    for field in fields.named.iter().filter(|field| is_public(&field.vis)) {
                        let name = field.ident.as_ref().map(ToString::to_string).unwrap_or_default();
                        self.add(&of, &format!("field {name}: {}", line(&field.ty)));
                    }
                }
            }
            Item::Enum(it) if is_public(&it.vis) && !is_hidden(&it.attrs) => {
                let open = if is_growing(&it.attrs) { " (non_exhaustive)" } else { "" };
                self.add(place, &format!("enum {}{open}", it.ident));
                let of = format!("{place}::{}", it.ident);
                for variant in &it.variants {
                    let mut bare = variant.clone();
                    bare.attrs.clear();
                    for field in &mut bare.fields {
                        field.attrs.clear();
                    }
                    self.add(&of, &format!("variant {}", line(&bare)));
                }
            }
            Item::Trait(it) if is_public(&it.vis) && !is_hidden(&it.attrs) => {
                self.add(place, &format!("trait {}", it.ident));
                let of = format!("{place}::{}", it.ident);
                for item in &it.items {
                    if let TraitItem::Fn(function) = item {
                        let given = if function.default.is_some() { " (provided)" } else { "" };
                        self.add(&of, &format!("{}{given}", line(&function.sig)));
                    }
                }
            }
            _ => {}
        }
    }

    /// The public methods of a type, and the traits that it has.
    fn block(&mut self, block: &syn::ItemImpl, place: &str) {
        if is_hidden(&block.attrs) {
            return;
        }
        let of = format!("{place}::{}", line(&block.self_ty));
        if let Some((_, path, _)) = &block.trait_ {
            self.add(&of, &format!("impl {}", line(path)));
            return;
        }
        for item in &block.items {
            match item {
                ImplItem::Fn(function) if is_public(&function.vis) && !is_hidden(&function.attrs) => {
                    self.add(&of, &line(&function.sig));
                }
                ImplItem::Const(it) if is_public(&it.vis) => {
                    self.add(&of, &format!("const {}: {}", it.ident, line(&it.ty)));
                }
                _ => {}
            }
        }
    }

    /// What is exported under another path.
    fn exports(&mut self, tree: &UseTree, place: &str, path: String) {
        match tree {
            UseTree::Path(it) => self.exports(&it.tree, place, format!("{path}{}::", it.ident)),
            UseTree::Name(it) => self.add(place, &format!("use {path}{}", it.ident)),
            UseTree::Rename(it) => self.add(place, &format!("use {path}{} as {}", it.ident, it.rename)),
            UseTree::Glob(_) => self.add(place, &format!("use {path}*")),
            UseTree::Group(group) => group.items.iter().for_each(|tree| self.exports(tree, place, path.clone())),
        }
    }
}

/// Whether fields or variants may be added without breaking anybody.
fn is_growing(attributes: &[syn::Attribute]) -> bool {
    attributes.iter().any(|attribute| attribute.path().is_ident("non_exhaustive"))
}

fn listed(folder: &str, name: &str) -> String {
    let sources = root().join("crates").join(folder).join("src");
    let text = std::fs::read_to_string(sources.join("lib.rs")).unwrap();
    let mut lister = Lister { lines: Vec::new() };
    lister.items(&syn::parse_file(&text).unwrap().items, name, &sources, true);
    lister.lines.sort();
    lister.lines.dedup();
    let mut out = String::new();
    for entry in lister.lines {
        writeln!(out, "{entry}").unwrap();
    }
    out
}

#[test]
fn the_public_api_is_the_one_that_is_written_down() {
    let update = std::env::var_os("SCRNN_UPDATE_API").is_some();
    let mut problems = Vec::new();
    for (folder, name) in LIBRARIES {
        let now = listed(folder, name);
        assert!(now.lines().count() > 2, "{name} shows nothing");
        let path = root().join(format!("docs/api/{name}.txt"));
        if update {
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            std::fs::write(&path, &now).unwrap();
            continue;
        }
        let written = std::fs::read_to_string(&path).unwrap_or_default();
        let missing = |a: &str, b: &str, sign: &str| -> Vec<String> {
            let b: std::collections::BTreeSet<&str> = b.lines().collect();
            a.lines().filter(|line| !b.contains(line)).map(|line| format!("{sign} {line}")).collect()
        };
        problems.extend(missing(&written, &now, "-"));
        problems.extend(missing(&now, &written, "+"));
    }
    assert!(
        problems.is_empty(),
        "the public API changed:\n{}\nif that is meant: SCRNN_UPDATE_API=1 cargo test -p scrnn-checks --test public_api, and a line in CHANGELOG.md",
        problems.join("\n")
    );
}

#[test]
fn the_list_has_what_a_user_would_look_for() {
    let api = listed("scrnn", "scrnn");
    for line in [
        "scrnn::network: struct Network",
        "scrnn::network::Network: fn topology(&self) -> &Topology",
        "scrnn::learning::learner::Outcome: variant Finished",
        "scrnn: use network::Network",
    ] {
        assert!(api.lines().any(|other| other.starts_with(line)), "{line}\n{api}");
    }
    assert!(!api.contains("kernels"), "kernels are hidden");
}
