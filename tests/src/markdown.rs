//! What the tests of the documentation read in a page: headings, links, blocks of commands and code within a line.

use anyhow::{Context, Result};
use pulldown_cmark::{CodeBlockKind, Event, Options, Parser, Tag, TagEnd};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Something in a page and the line, from 1, where it stands.
#[derive(Clone, Debug, PartialEq)]
pub struct Found {
    /// The line.
    pub line: usize,
    /// The target of a link, or a text.
    pub text: String,
}

/// A page.
#[derive(Clone, Debug, Default)]
pub struct Page {
    /// The file.
    pub file: PathBuf,
    /// Anchors of the headings, as both GitHub and mdBook name them.
    pub anchors: Vec<String>,
    /// Targets of links and pictures.
    pub links: Vec<Found>,
    /// Command lines of blocks marked `sh`, `bash` or `console`.
    pub commands: Vec<Found>,
    /// Code within a line.
    pub spans: Vec<Found>,
    /// Blocks that are whole files, marked `file=NAME` behind their language: name and text.
    pub files: Vec<(PathBuf, String)>,
}

impl Page {
    /// Reads a page.
    pub fn read(file: &Path) -> Result<Self> {
        let text = std::fs::read_to_string(file).with_context(|| file.display().to_string())?;
        Ok(Self { file: file.to_owned(), ..Self::parse(&text) })
    }

    /// Parses a page's text.
    pub fn parse(text: &str) -> Self {
        let mut page = Self::default();
        let mut counts: BTreeMap<String, usize> = BTreeMap::new();
        let (mut heading, mut block): (Option<String>, Option<(String, usize, String)>) = (None, None);
        for (event, range) in Parser::new_ext(text, Options::ENABLE_TABLES).into_offset_iter() {
            let line = 1 + text[..range.start].matches('\n').count();
            match event {
                Event::Start(Tag::Heading { .. }) => heading = Some(String::new()),
                Event::End(TagEnd::Heading(_)) => {
                    page.anchors.push(anchor(&heading.take().unwrap_or_default(), &mut counts))
                }
                Event::Start(Tag::Link { dest_url, .. } | Tag::Image { dest_url, .. }) => {
                    page.links.push(Found { line, text: dest_url.into_string() });
                }
                Event::Start(Tag::CodeBlock(CodeBlockKind::Fenced(language))) => {
                    block = Some((language.into_string(), line + 1, String::new()));
                }
                Event::End(TagEnd::CodeBlock) => {
                    if let Some((language, first, text)) = block.take() {
                        page.commands.extend(commands(&language, first, &text));
                        let name = language.split_once("file=").map(|(_, name)| PathBuf::from(name.trim()));
                        page.files.extend(name.map(|name| (name, text)));
                    }
                }
                Event::Code(code) => {
                    if let Some(heading) = &mut heading {
                        heading.push_str(&code);
                    }
                    page.spans.push(Found { line, text: code.into_string() });
                }
                Event::Text(part) => {
                    if let Some((_, _, text)) = &mut block {
                        text.push_str(&part);
                    } else if let Some(heading) = &mut heading {
                        heading.push_str(&part);
                    }
                }
                _ => {}
            }
        }
        page
    }
}

/// The anchor of a heading; a second heading of the same words gets a number.
fn anchor(heading: &str, counts: &mut BTreeMap<String, usize>) -> String {
    let keep = |c: char| match c {
        ' ' => Some('-'),
        c if c.is_alphanumeric() || c == '-' || c == '_' => Some(c.to_ascii_lowercase()),
        _ => None,
    };
    let name: String = heading.trim().chars().filter_map(keep).collect();
    let count = counts.entry(name.clone()).or_default();
    *count += 1;
    if *count == 1 { name } else { format!("{name}-{}", *count - 1) }
}

/// The lines of a block that are typed: all of `sh` and `bash`, those behind `$` of `console`. A line that ends with `\`
/// goes on in the next.
fn commands(language: &str, first: usize, text: &str) -> Vec<Found> {
    let is_typed = |line: &str| match language {
        "sh" | "bash" => Some(line.to_owned()),
        "console" => line.strip_prefix("$ ").map(str::to_owned),
        _ => None,
    };
    let mut found: Vec<Found> = Vec::new();
    let mut goes_on = false;
    for (i, line) in text.lines().enumerate() {
        let typed = if goes_on { Some(line.to_owned()) } else { is_typed(line) };
        let Some(typed) = typed.filter(|typed| !typed.trim().is_empty()) else { continue };
        let (part, more) = typed.strip_suffix('\\').map_or((typed.as_str(), false), |part| (part, true));
        match found.last_mut() {
            Some(last) if goes_on => last.text.push_str(part),
            _ => found.push(Found { line: first + i, text: part.to_owned() }),
        }
        goes_on = more;
    }
    found
}
