//! Contract: what the documentation says can be followed. Every link and anchor leads somewhere, every page is in the
//! book, every `dsm` command is one that the program takes, files that commands name are there, and the reference is what
//! the program says of itself.

#![allow(clippy::unwrap_used, reason = "a test that cannot read the pages fails")]

use dsm_tasks::cli::{WorldArgs, prepare};
use scenarios::commands::{check_mention, find_dsm, parse, words};
use scenarios::markdown::Page;
use scenarios::{reference, root};
use std::collections::BTreeMap;
use std::fs;
use std::path::{Component, Path, PathBuf};

/// Pages outside of the book.
const ROOT_PAGES: [&str; 5] = ["README.md", "ARCHITECTURE.md", "CONTRIBUTING.md", "CHANGELOG.md", "THIRD_PARTY.md"];
/// A picture of the book is at most so large, bytes.
const MOST_PICTURE_BYTES: u64 = 200_000;

fn files_below(folder: &Path, ending: &str, found: &mut Vec<PathBuf>) {
    let mut entries: Vec<PathBuf> = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()).collect();
    entries.sort();
    for path in entries {
        if path.is_dir() {
            files_below(&path, ending, found);
        } else if path.extension().is_some_and(|e| e == ending) {
            found.push(path);
        }
    }
}

fn book_files(ending: &str) -> Vec<PathBuf> {
    let mut files = Vec::new();
    files_below(&root().join("docs"), ending, &mut files);
    files
}

fn pages() -> Vec<Page> {
    let files = ROOT_PAGES.iter().map(|name| root().join(name)).chain(book_files("md"));
    files.map(|file| Page::read(&file).unwrap()).collect()
}

/// A path without `.` and `..`, so that two ways to a file are one.
fn normal(path: &Path) -> PathBuf {
    let mut whole = PathBuf::new();
    for part in path.components() {
        match part {
            Component::CurDir => {}
            Component::ParentDir => drop(whole.pop()),
            part => whole.push(part),
        }
    }
    whole
}

/// Where a file stands, for people.
fn at(page: &Page, line: usize) -> String {
    let root = normal(&root());
    format!("{}:{line}", normal(&page.file).strip_prefix(root).unwrap_or(&page.file).display())
}

/// Links of the pages that lead nowhere. `book` is the folder of the book: its pages may link nothing outside of it.
fn broken_links(pages: &[Page], book: &Path) -> Vec<String> {
    let anchors: BTreeMap<PathBuf, &Vec<String>> =
        pages.iter().map(|page| (normal(&page.file), &page.anchors)).collect();
    let mut broken = Vec::new();
    for page in pages {
        for link in &page.links {
            if link.text.contains("://") || link.text.starts_with("mailto:") {
                continue;
            }
            let (path, anchor) = link.text.split_once('#').map_or((link.text.as_str(), None), |(p, a)| (p, Some(a)));
            let file = match path {
                "" => normal(&page.file),
                path => normal(&page.file.parent().unwrap().join(path)),
            };
            let why = if !file.exists() {
                "no such file"
            } else if page.file.starts_with(book) && !file.starts_with(normal(book)) {
                "lies outside of the book"
            } else if anchor.is_some_and(|anchor| !anchors.get(&file).is_some_and(|a| a.iter().any(|a| a == anchor))) {
                "no such heading"
            } else {
                continue;
            };
            broken.push(format!("{}: {}: {why}", at(page, link.line), link.text));
        }
    }
    broken
}

fn assert_none(found: Vec<String>, rule: &str) {
    assert!(found.is_empty(), "{rule}:\n  {}", found.join("\n  "));
}

#[test]
fn every_link_and_anchor_leads_somewhere() {
    let pages = pages();
    assert!(pages.iter().map(|page| page.links.len()).sum::<usize>() > 60, "links were not found");
    assert_none(broken_links(&pages, &root().join("docs")), "links that lead nowhere");
}

#[test]
fn a_broken_link_is_found() {
    let folder = tempfile::tempdir().unwrap();
    let book = folder.path().join("book");
    fs::create_dir(&book).unwrap();
    fs::write(
        book.join("a.md"),
        "# A `b` c\n[x](a.md#a-b-c) [y](b.md)\n\n## A b c\n[z](#a-b-c-1) [u](#d) [v](../o.md)\n",
    )
    .unwrap();
    fs::write(folder.path().join("o.md"), "# O\n![p](book/p.png)\n").unwrap();
    let pages = [book.join("a.md"), folder.path().join("o.md")].map(|file| Page::read(&file).unwrap());
    let broken = broken_links(&pages, &book);
    assert_eq!(broken.len(), 4, "{broken:?}");
    for (line, part) in [
        (0, "a.md:2: b.md: no such file"),
        (1, "a.md:5: #d: no such heading"),
        (2, "a.md:5: ../o.md: lies outside"),
        (3, "o.md:2: book/p.png: no such file"),
    ] {
        assert!(broken[line].contains(part), "{broken:?}");
    }
}

#[test]
fn every_page_stands_in_the_book_once() {
    let book = root().join("docs");
    let summary = Page::read(&book.join("SUMMARY.md")).unwrap();
    let mut listed: Vec<PathBuf> = summary.links.iter().map(|link| normal(&book.join(&link.text))).collect();
    listed.sort();
    let mut files: Vec<PathBuf> = book_files("md").iter().map(|file| normal(file)).collect();
    files.retain(|file| !file.ends_with("SUMMARY.md"));
    files.sort();
    let missing: Vec<String> =
        files.iter().filter(|file| !listed.contains(file)).map(|file| file.display().to_string()).collect();
    assert_none(missing, "pages that docs/SUMMARY.md does not list");
    assert_eq!(listed, files, "docs/SUMMARY.md lists each page once and nothing else");
}

#[test]
fn every_command_is_one_that_the_program_takes() {
    let (mut wrong, mut tried) = (Vec::new(), 0);
    for page in pages() {
        // What a page has people copy is there from then on.
        let mut made: Vec<String> = Vec::new();
        for line in &page.commands {
            let commands = match words(&line.text) {
                Ok(commands) => commands,
                Err(why) => {
                    wrong.push(format!("{}: {why}", at(&page, line.line)));
                    continue;
                }
            };
            for command in commands {
                if let Some(arguments) = find_dsm(&command) {
                    tried += 1;
                    wrong.extend(parse(arguments).err().map(|why| format!("{}: {why}", at(&page, line.line))));
                }
                let missing = missing_files(&command).into_iter().filter(|file| !made.contains(file));
                if command[0] == "cp" {
                    made.extend(command.last().cloned());
                } else {
                    wrong.extend(missing.map(|file| format!("{}: {file} is not there", at(&page, line.line))));
                }
            }
        }
    }
    assert!(tried > 40, "only {tried} commands found");
    assert_none(wrong, "commands that cannot be followed");
}

/// Programs and scenes of the repository that a command names and that are not there.
fn missing_files(command: &[String]) -> Vec<String> {
    let is_script = |word: &String| ["tests/", "sim/", "robot/", "dsm/"].iter().any(|folder| word.starts_with(folder));
    let script = command.first().filter(|word| is_script(word));
    let scenes = command.iter().filter(|word| word.starts_with("scenes/") && !word.contains('*'));
    let named = script.into_iter().chain(scenes);
    named.filter(|word| !root().join(word).exists()).cloned().collect()
}

#[test]
fn every_mention_of_a_command_names_what_there_is() {
    let (mut wrong, mut tried) = (Vec::new(), 0);
    for page in pages().iter().filter(|page| !page.file.ends_with("CHANGELOG.md")) {
        for span in page.spans.iter().filter(|span| span.text.starts_with("dsm ")) {
            for command in words(&span.text.replace('|', " ")).unwrap() {
                tried += 1;
                let checked = check_mention(find_dsm(&command).unwrap_or_default());
                wrong.extend(checked.err().map(|why| format!("{}: `{}`: {why}", at(page, span.line), span.text)));
            }
        }
    }
    assert!(tried > 80, "only {tried} mentions found");
    assert_none(wrong, "mentions of what there is not");
}

#[test]
fn a_wrong_command_is_found() {
    let page = Page::parse(
        "```sh\nDSM_SEED=1 dsm run a.toml --sed 3 > x &  # why\n```\n\n```console\n$ cargo run --release -- ground m \\\n  'a b'\nout\n```\n\
         ```toml\ndsm = 1\n```\n",
    );
    assert_eq!(page.commands.iter().map(|c| c.line).collect::<Vec<_>>(), [2, 6]);
    let commands: Vec<Vec<String>> = page.commands.iter().flat_map(|line| words(&line.text).unwrap()).collect();
    assert_eq!(commands[0], ["DSM_SEED=1", "dsm", "run", "a.toml", "--sed", "3"]);
    let parsed: Vec<_> = commands.iter().map(|command| parse(find_dsm(command).unwrap())).collect();
    assert!(parsed[0].as_ref().is_err_and(|why| why.contains("--sed")), "{parsed:?}");
    assert_eq!(parsed[1], Ok(()), "a command goes on in the next line");
    assert_eq!(missing_files(&words("tests/nothing scenes/none").unwrap()[0]).len(), 2);
    let mention = |text: &str| check_mention(&words(text).unwrap()[0]);
    assert_eq!(mention("map export MAP FILE --format nav2"), Ok(()));
    assert!(mention("map exports").is_err() && mention("suite --worker 2").is_err() && mention("fly").is_err());
}

#[test]
fn the_reference_is_what_the_program_says() {
    let folder = root().join("docs/reference");
    for (name, text) in reference::pages() {
        let written = fs::read_to_string(folder.join(&name)).unwrap_or_default();
        let line = 1 + written.lines().zip(text.lines()).take_while(|(a, b)| a == b).count();
        assert!(
            written == text,
            "docs/reference/{name}:{line} is not up to date: cargo run --release -p scenarios --example reference"
        );
    }
}

#[test]
fn the_files_of_the_book_load() {
    let page = Page::read(&root().join("docs/own_scene.md")).unwrap();
    let folder = tempfile::tempdir().unwrap();
    for (name, text) in &page.files {
        let file = folder.path().join(name);
        fs::create_dir_all(file.parent().unwrap()).unwrap();
        fs::write(file, text).unwrap();
    }
    let episode = folder.path().join("my_scene/episodes/fetch_can.toml");
    let (spec, _) = prepare(&episode, &WorldArgs::default()).unwrap();
    dsm_tasks::assemble::check(&spec).unwrap();
}

#[test]
fn pictures_of_the_book_are_small() {
    let pictures = book_files("png");
    assert!(pictures.len() >= 3, "pictures were not found");
    let large = pictures.iter().filter(|file| fs::metadata(file).unwrap().len() > MOST_PICTURE_BYTES);
    assert_none(large.map(|file| file.display().to_string()).collect(), "pictures above 200 kB");
}
