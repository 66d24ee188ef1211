//! The format of the tables.

use super::category::{Category, KnowledgeError};
use super::words::{ColorPrototype, WordList, Words};
use serde::Deserialize;
use std::collections::{BTreeMap, BTreeSet};

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct CategoryTable {
    version: u32,
    kinds: BTreeMap<String, KindRow>,
    categories: BTreeMap<String, CategoryRow>,
}

/// What the categories of one kind share.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct KindRow {
    hypernyms: Vec<String>,
    rooms: Vec<String>,
    materials: Vec<String>,
    uses: Vec<String>,
    operate: Vec<String>,
    graspable: bool,
    #[serde(default)]
    used_with: Vec<String>,
    #[serde(default)]
    stored_in: Vec<String>,
    depth_m: Option<f64>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct CategoryRow {
    kind: String,
    mass_kg: Option<f64>,
    size_m: Option<[f64; 2]>,
    depth_m: Option<f64>,
    #[serde(default)]
    synonyms: Vec<String>,
    #[serde(default)]
    similar: Vec<String>,
    #[serde(default)]
    part_of: Vec<String>,
    hypernyms: Option<Vec<String>>,
    rooms: Option<Vec<String>>,
    materials: Option<Vec<String>>,
    uses: Option<Vec<String>>,
    operate: Option<Vec<String>>,
    graspable: Option<bool>,
    used_with: Option<Vec<String>>,
    stored_in: Option<Vec<String>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct WordTable {
    version: u32,
    colors: BTreeMap<String, ColorRow>,
    materials: BTreeMap<String, WordRow>,
    sizes: BTreeMap<String, WordRow>,
    shapes: BTreeMap<String, WordRow>,
    patterns: BTreeMap<String, WordRow>,
    weights: BTreeMap<String, WordRow>,
    rooms: BTreeMap<String, WordRow>,
    purposes: BTreeMap<String, WordRow>,
    room_marks: BTreeMap<String, Vec<String>>,
    unmarked_rooms: BTreeSet<String>,
    repeated_rooms: BTreeSet<String>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct WordRow {
    synonyms: Vec<String>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct ColorRow {
    synonyms: Vec<String>,
    srgb: [u8; 3],
}

fn check_version(table: &'static str, found: u32) -> Result<(), KnowledgeError> {
    if found == 1 { Ok(()) } else { Err(KnowledgeError::Version { table, found }) }
}

pub(super) fn read_categories(text: &str) -> Result<Vec<Category>, KnowledgeError> {
    let table: CategoryTable = toml::from_str(text)
        .map_err(|source| KnowledgeError::Format { table: "categories.toml", source: Box::new(source) })?;
    check_version("categories.toml", table.version)?;
    let fill = |(name, row): (String, CategoryRow)| {
        let kind = table.kinds.get(&row.kind).ok_or_else(|| KnowledgeError::UnknownKind {
            category: name.clone(),
            kind: row.kind.clone(),
            known: table.kinds.keys().cloned().collect::<Vec<_>>().join(", "),
        })?;
        let or_kind = |own: Option<Vec<String>>, shared: &[String]| own.unwrap_or_else(|| shared.to_vec());
        Ok(Category {
            synonyms: row.synonyms,
            hypernyms: or_kind(row.hypernyms, &kind.hypernyms).into_iter().filter(|h| *h != name).collect(),
            similar: row.similar,
            rooms: or_kind(row.rooms, &kind.rooms),
            materials: or_kind(row.materials, &kind.materials),
            mass_kg: row.mass_kg,
            size_m: row.size_m,
            depth_m: row.depth_m.or(kind.depth_m),
            uses: or_kind(row.uses, &kind.uses),
            operate: or_kind(row.operate, &kind.operate),
            graspable: row.graspable.unwrap_or(kind.graspable),
            used_with: or_kind(row.used_with, &kind.used_with).into_iter().filter(|c| *c != name).collect(),
            part_of: row.part_of,
            stored_in: or_kind(row.stored_in, &kind.stored_in).into_iter().filter(|c| *c != name).collect(),
            name,
        })
    };
    table.categories.into_iter().map(fill).collect()
}

pub(super) fn read_words(text: &str) -> Result<Words, KnowledgeError> {
    let table: WordTable = toml::from_str(text)
        .map_err(|source| KnowledgeError::Format { table: "words.toml", source: Box::new(source) })?;
    check_version("words.toml", table.version)?;
    let list =
        |rows: BTreeMap<String, WordRow>| WordList::new(rows.into_iter().map(|(word, row)| (word, row.synonyms)));
    Ok(Words {
        prototypes: table
            .colors
            .iter()
            .map(|(name, row)| ColorPrototype { name: name.clone(), srgb: row.srgb })
            .collect(),
        colors: WordList::new(table.colors.into_iter().map(|(word, row)| (word, row.synonyms))),
        materials: list(table.materials),
        sizes: list(table.sizes),
        shapes: list(table.shapes),
        patterns: list(table.patterns),
        weights: list(table.weights),
        rooms: list(table.rooms),
        purposes: list(table.purposes),
        room_marks: table.room_marks,
        unmarked_rooms: table.unmarked_rooms,
        repeated_rooms: table.repeated_rooms,
    })
}
