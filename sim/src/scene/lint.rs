//! Checks a scene's XML before it is built: names, numbers and references, each finding with its line.

use super::error::SceneError;
use super::grammar::{UNSUPPORTED, Value, find_attributes, find_children};
use super::source::Source;
use roxmltree::{Attribute, Document, Node};
use std::collections::BTreeMap;

/// Checks the whole document; the first thing that is wrong is the error.
pub(super) fn check_document(document: &Document<'_>, source: &Source) -> Result<(), SceneError> {
    let lint = Lint { source };
    for node in document.root_element().descendants().filter(Node::is_element) {
        if inside_unchecked(node) && node != document.root_element() {
            continue;
        }
        lint.check_children(node)?;
        lint.check_attributes(node)?;
    }
    let names = lint.collect_names(document)?;
    document.root_element().descendants().filter(|n| !inside_unchecked(*n)).try_for_each(|n| lint.check_refs(n, &names))
}

/// Whether the node lies in a top-level block that has nothing to do with geometry, such as `<visual>`.
fn inside_unchecked(node: Node<'_, '_>) -> bool {
    let root = node.document().root_element();
    let top = node.ancestors().find(|ancestor| ancestor.parent() == Some(root));
    top.is_none_or(|top| !matches!(top.tag_name().name(), "compiler" | "worldbody" | "asset" | "default"))
}

/// Names by kind.
type Names<'a> = BTreeMap<&'static str, BTreeMap<&'a str, usize>>;

struct Lint<'a> {
    source: &'a Source,
}

impl Lint<'_> {
    fn check_children(&self, node: Node<'_, '_>) -> Result<(), SceneError> {
        let parent = node.tag_name().name();
        let Some(valid) = find_children(parent) else { return Ok(()) };
        for child in node.children().filter(Node::is_element) {
            let name = child.tag_name().name();
            let place = self.source.place(child.range().start);
            if let Some((what, hint)) = UNSUPPORTED.iter().find(|(what, _)| *what == name) {
                return Err(SceneError::Unsupported { place, what: format!("<{what}>"), hint: (*hint).to_owned() });
            }
            if !valid.contains(&name) {
                return Err(SceneError::UnknownKey {
                    place,
                    kind: "element",
                    name: name.into(),
                    parent: parent.into(),
                    nearest: dsm::config::find_nearest(name, valid.iter().copied()).map(Into::into),
                    valid: valid.iter().map(|v| (*v).to_owned()).collect(),
                });
            }
        }
        Ok(())
    }

    fn check_attributes(&self, node: Node<'_, '_>) -> Result<(), SceneError> {
        let element = node.tag_name().name();
        let Some(valid) = find_attributes(element) else { return Ok(()) };
        for attribute in node.attributes() {
            let Some((_, value)) = valid.iter().find(|(name, _)| *name == attribute.name()) else {
                return Err(SceneError::UnknownKey {
                    place: self.source.place(attribute.range().start),
                    kind: "attribute",
                    name: attribute.name().into(),
                    parent: element.into(),
                    nearest: dsm::config::find_nearest(attribute.name(), valid.iter().map(|(n, _)| *n)).map(Into::into),
                    valid: valid.iter().map(|(name, _)| (*name).to_owned()).collect(),
                });
            };
            if let Some(expected) = find_misfit(attribute.value(), *value) {
                return Err(self.bad_value(element, attribute, expected));
            }
        }
        Ok(())
    }

    fn bad_value(&self, element: &str, attribute: Attribute<'_, '_>, expected: String) -> SceneError {
        SceneError::BadValue {
            place: self.source.place(attribute.range().start),
            what: format!("`{}` of <{element}>", attribute.name()),
            value: attribute.value().to_owned(),
            expected,
        }
    }

    /// Every defined name by kind; a name defined twice is an error.
    fn collect_names<'a>(&self, document: &'a Document<'_>) -> Result<Names<'a>, SceneError> {
        let mut names = Names::new();
        for kind in ["body", "geom", "material", "texture", "mesh", "class"] {
            names.insert(kind, BTreeMap::new());
        }
        for node in document.root_element().descendants().filter(|n| n.is_element() && !inside_unchecked(*n)) {
            let in_default = node.ancestors().any(|a| a.has_tag_name("default"));
            let (kind, name) = match node.tag_name().name() {
                "default" => ("class", node.attribute("class")),
                "body" => ("body", node.attribute("name")),
                "geom" if !in_default => ("geom", node.attribute("name")),
                "material" if !in_default => ("material", node.attribute("name")),
                "mesh" if !in_default => ("mesh", node.attribute("name").or_else(|| stem(node))),
                "texture" if !in_default => ("texture", node.attribute("name").or_else(|| stem(node))),
                _ => continue,
            };
            let (Some(name), Some(known)) = (name, names.get_mut(kind)) else { continue };
            let first = known.insert(name, node.range().start);
            // Two top-level default blocks may extend the same class.
            if let (Some(first), false) = (first, kind == "class") {
                return Err(SceneError::Duplicate {
                    place: self.source.place(node.range().start),
                    kind,
                    name: name.to_owned(),
                    first: self.source.place(first),
                });
            }
        }
        if let Some(classes) = names.get_mut("class") {
            classes.entry("main").or_insert(0);
        }
        Ok(names)
    }

    fn check_refs(&self, node: Node<'_, '_>, names: &Names<'_>) -> Result<(), SceneError> {
        let in_default = node.ancestors().any(|a| a.has_tag_name("default"));
        let references: &[(&str, &'static str)] = match node.tag_name().name() {
            "geom" | "site" => &[("material", "material"), ("mesh", "mesh"), ("class", "class")],
            "material" => &[("texture", "texture"), ("class", "class")],
            "body" | "frame" => &[("childclass", "class")],
            "mesh" | "joint" | "light" => &[("class", "class")],
            _ => &[],
        };
        for (attribute, kind) in references {
            let Some(written) = node.attribute_node(*attribute) else { continue };
            let Some(known) = names.get(kind) else { continue };
            let refers_later = in_default && *attribute == "class";
            if !refers_later && !known.contains_key(written.value()) {
                return Err(SceneError::UnknownReference {
                    place: self.source.place(written.range().start),
                    kind,
                    name: written.value().to_owned(),
                    nearest: dsm::config::find_nearest(written.value(), known.keys().copied()).map(str::to_owned),
                    known: known.keys().map(|name| (*name).to_owned()).collect(),
                });
            }
        }
        Ok(())
    }
}

/// The name that MuJoCo gives an asset without one: its file's name without folder and ending.
fn stem<'a>(node: Node<'a, '_>) -> Option<&'a str> {
    std::path::Path::new(node.attribute("file")?).file_stem()?.to_str()
}

/// What was expected, when the text does not fit.
fn find_misfit(text: &str, value: Value) -> Option<String> {
    let numbers = |least: usize, most: usize, low: f64| {
        let parsed: Vec<Option<f64>> = text.split_ascii_whitespace().map(|word| word.parse().ok()).collect();
        let count_fits = (least..=most).contains(&parsed.len());
        let values_fit = parsed.iter().all(|v| v.is_some_and(|v| v.is_finite() && v >= low));
        let count = if least == most { format!("{least}") } else { format!("{least} to {most}") };
        let unit = if most == 1 { "number" } else { "numbers" };
        let bound = if low == 0.0 { " >= 0" } else { "" };
        (!count_fits || !values_fit).then(|| format!("{count} {unit}{bound}"))
    };
    match value {
        Value::Text => None,
        Value::Numbers(least, most) => numbers(least, most, f64::NEG_INFINITY),
        Value::Positive(least, most) => numbers(least, most, 0.0),
        Value::Whole => text.trim().parse::<i64>().err().map(|_| "a whole number".to_owned()),
        Value::Word(words) => (!words.contains(&text)).then(|| format!("one of {}", words.join(", "))),
    }
}
