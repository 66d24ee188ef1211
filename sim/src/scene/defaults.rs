//! Attributes of an element as its default classes complete them.

use roxmltree::{Document, Node};
use std::collections::BTreeMap;

/// The class that all elements without one have.
const MAIN: &str = "main";

/// Default classes of a document. Several blocks may extend one class.
pub(super) struct Defaults<'a> {
    /// Blocks of each class in document order, each with the class that it extends.
    classes: BTreeMap<&'a str, Vec<(Node<'a, 'a>, Option<&'a str>)>>,
}

impl<'a> Defaults<'a> {
    pub(super) fn new(document: &'a Document<'a>) -> Self {
        let mut classes: BTreeMap<&str, Vec<_>> = BTreeMap::new();
        for block in document.root_element().descendants().filter(|node| node.has_tag_name("default")) {
            let parent = block.parent().filter(|parent| parent.has_tag_name("default"));
            let extended = parent.map(|parent| parent.attribute("class").unwrap_or(MAIN));
            classes.entry(block.attribute("class").unwrap_or(MAIN)).or_default().push((block, extended));
        }
        Self { classes }
    }

    /// An attribute of an element: its own, else that of its class, of the class that this extends, and so on.
    pub(super) fn find(&self, node: Node<'a, 'a>, attribute: &str) -> Option<&'a str> {
        if let Some(own) = node.attribute(attribute) {
            return Some(own);
        }
        let inherited = || {
            let holders = node.ancestors().skip(1).filter(|a| a.has_tag_name("body") || a.has_tag_name("frame"));
            holders.into_iter().find_map(|holder| holder.attribute("childclass"))
        };
        let mut next = Some(node.attribute("class").or_else(inherited).unwrap_or(MAIN));
        // A class cannot be its own ancestor, for blocks are nested; the bound is for two blocks of one name.
        for _ in 0..=self.classes.len() {
            let blocks = self.classes.get(next?)?;
            let of_element = |block: &Node<'a, 'a>| {
                let children = block.children().filter(|child| child.tag_name().name() == node.tag_name().name());
                children.filter_map(|child| child.attribute(attribute)).next_back()
            };
            if let Some(value) = blocks.iter().rev().find_map(|(block, _)| of_element(block)) {
                return Some(value);
            }
            next = blocks.iter().find_map(|(_, extended)| *extended);
        }
        None
    }
}

/// Whether a node stands in a `<default>` block: it describes others and is nothing itself.
pub(super) fn is_default(node: &Node<'_, '_>) -> bool {
    node.ancestors().skip(1).any(|ancestor| ancestor.has_tag_name("default"))
}

#[cfg(test)]
mod tests {
    //! Contract: own attributes win over the class's, those over what the class extends; `childclass` reaches down.
    use super::*;

    #[test]
    fn attributes_come_down_the_classes() {
        let text = r#"<mujoco><default><light castshadow="false" dir="1 0 0"/>
            <default class="a"><light dir="0 1 0"/><default class="b"><light pos="1 1 1"/></default></default></default>
            <worldbody><light/><light class="a"/><body childclass="b"><frame><light dir="0 0 1"/><light/></frame></body>
            </worldbody></mujoco>"#;
        let document = Document::parse(text).expect("sound");
        let defaults = Defaults::new(&document);
        let lights: Vec<_> = document.descendants().filter(|n| n.has_tag_name("light") && !is_default(n)).collect();
        let dirs: Vec<_> = lights.iter().map(|light| defaults.find(*light, "dir")).collect();
        assert_eq!(dirs, [Some("1 0 0"), Some("0 1 0"), Some("0 0 1"), Some("0 1 0")]);
        assert_eq!(defaults.find(lights[3], "pos"), Some("1 1 1"));
        assert!(lights.iter().all(|light| defaults.find(*light, "castshadow") == Some("false")));
        assert_eq!(defaults.find(lights[0], "pos"), None);
    }
}
