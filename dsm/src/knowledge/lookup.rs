//! Names to categories, and how alike two names are.

use super::category::{Category, Knowledge};
use super::wording::{normalize, singular_of};

/// Hypernyms so wide that sharing one says little.
const WIDE_KINDS: [&str; 8] =
    ["furniture", "electronics", "container", "food", "textile", "tool", "decoration", "structure"];

/// A name that was looked up.
#[derive(Clone, Debug)]
pub struct Meaning<'k> {
    name: String,
    category: Option<&'k Category>,
    kind: Option<&'k str>,
}

impl Knowledge {
    /// The category of a name. Tried in this order: the name or a synonym; its singular; the same without spaces;
    /// a name one letter away (from 4 letters on; two from 8 letters on, and the first letter must agree) if all such
    /// names belong to one category; the head of a phrase (`chair` of "black leather chair", `bowl` of "bowl of fruit").
    pub fn find(&self, name: &str) -> Option<&Category> {
        if let Some(&i) = self.index.get(name) {
            return Some(&self.categories[i]);
        }
        let name = normalize(name);
        self.find_spelled(&name)
            .or_else(|| self.find_misspelled(&name))
            .or_else(|| self.find_head(&name))
            .map(|i| &self.categories[i])
    }

    /// As [`find`](Self::find), but only exact names, synonyms, plurals and joined spellings.
    pub fn find_exact(&self, name: &str) -> Option<&Category> {
        self.find_spelled(&normalize(name)).map(|i| &self.categories[i])
    }

    /// As [`find`](Self::find), but without looking at the head of a phrase.
    pub fn find_tolerant(&self, name: &str) -> Option<&Category> {
        let name = normalize(name);
        self.find_spelled(&name).or_else(|| self.find_misspelled(&name)).map(|i| &self.categories[i])
    }

    /// The canonical word if categories are kinds of it, for example `fruit`, `furniture` or `containers`.
    pub fn find_kind(&self, name: &str) -> Option<&str> {
        let name = normalize(name);
        let known = |name: &str| self.kinds.get_key_value(name).map(|(kind, _)| kind.as_str());
        known(&name).or_else(|| singular_of(&name).iter().find_map(|singular| known(singular)))
    }

    /// How alike two names are, 0 to 1: 1 for the same name or a synonym, 0.9 when one is the direct kind of the other,
    /// 0.8 for a wider kind, 0.65 for look-alikes, 0.5 for siblings of one specific kind, 0.2 for a shared wide kind;
    /// for names that the table does not hold, by spelling.
    pub fn similarity(&self, a: &str, b: &str) -> f32 {
        self.similarity_to(&self.meaning(a), b)
    }

    /// Looks a name up once, to compare it with many by [`similarity_to`](Self::similarity_to).
    pub fn meaning(&self, name: &str) -> Meaning<'_> {
        Meaning { name: normalize(name), category: self.find(name), kind: self.find_kind(name) }
    }

    /// As [`similarity`](Self::similarity), with one name looked up before.
    pub fn similarity_to(&self, a: &Meaning<'_>, b: &str) -> f32 {
        match (a.category, self.find(b)) {
            (Some(a), Some(b)) => self.category_similarity(a, b),
            (Some(category), None) => kind_similarity(category, self.find_kind(b)),
            (None, Some(category)) => kind_similarity(category, a.kind),
            (None, None) => spelling_similarity(&a.name, &normalize(b)),
        }
    }

    /// How alike two categories are; see [`similarity`](Self::similarity).
    pub fn category_similarity(&self, a: &Category, b: &Category) -> f32 {
        if a.name == b.name {
            return 1.0;
        }
        let one_way = |narrow: &Category, wide: &Category| match narrow.hypernyms.iter().position(|h| *h == wide.name) {
            Some(0) => 0.9,
            Some(_) => 0.8,
            None => 0.0,
        };
        let kind_of: f32 = f32::max(one_way(a, b), one_way(b, a));
        let look_alike = if a.similar.contains(&b.name) || b.similar.contains(&a.name) { 0.65 } else { 0.0 };
        let shared = a.hypernyms.iter().filter(|h| b.hypernyms.contains(h)).map(|h| self.width_score(h));
        shared.fold(kind_of.max(look_alike), f32::max)
    }

    fn width_score(&self, hypernym: &str) -> f32 {
        if WIDE_KINDS.contains(&hypernym) { 0.2 } else { 0.5 }
    }

    pub(super) fn find_spelled(&self, name: &str) -> Option<usize> {
        if let Some(&i) = self.index.get(name) {
            return Some(i);
        }
        if let Some(i) = singular_of(name).iter().find_map(|singular| self.index.get(singular)) {
            return Some(*i);
        }
        let joined: String = name.chars().filter(|c| *c != ' ').collect();
        (joined != name).then(|| self.index.get(&joined).copied()).flatten()
    }

    fn find_misspelled(&self, name: &str) -> Option<usize> {
        // The first letter must agree, and the index is in alphabetical order.
        let first = name.chars().next()?;
        let mut best: Option<(usize, usize)> = None;
        let mut unique = true;
        let same_letter = self.index.range(first.to_string()..).take_while(|(known, _)| known.starts_with(first));
        for (known, &category) in same_letter {
            let Some(distance) = misspelling_distance(name, known) else { continue };
            match best {
                Some((least, _)) if distance > least => {}
                Some((least, owner)) if distance == least => unique &= owner == category,
                _ => (best, unique) = (Some((distance, category)), true),
            }
        }
        best.filter(|_| unique).map(|(_, category)| category)
    }

    fn find_head(&self, name: &str) -> Option<usize> {
        let head = name.split(" of ").next().unwrap_or(name);
        if head != name
            && let Some(i) = self.find_spelled(head)
        {
            return Some(i);
        }
        // The longest known ending is the most specific head.
        let mut rest = head;
        while let Some((_, tail)) = rest.split_once(' ') {
            if let Some(i) = self.find_spelled(tail) {
                return Some(i);
            }
            rest = tail;
        }
        None
    }
}

fn kind_similarity(category: &Category, kind: Option<&str>) -> f32 {
    match kind.and_then(|kind| category.hypernyms.iter().position(|hypernym| hypernym == kind)) {
        Some(0) => 0.9,
        Some(_) => 0.8,
        None => 0.0,
    }
}

fn spelling_similarity(a: &str, b: &str) -> f32 {
    if a.is_empty() || b.is_empty() {
        return 0.0;
    }
    if a == b || singular_of(a).iter().any(|s| s == b) || singular_of(b).iter().any(|s| s == a) {
        return 1.0;
    }
    let head = |name: &str| name.rsplit(' ').next().unwrap_or(name).to_owned();
    let heads = if head(a) == head(b) { 0.7 } else { 0.0 };
    let spelling = strsim::normalized_damerau_levenshtein(a, b) as f32;
    if spelling >= 0.8 { spelling.max(heads) } else { heads }
}

/// How many letters are wrong, missing, too many or swapped when `written` is a misspelt `known`: one at most, two from 8
/// letters on, the first one right; `None` for words that are too short to tell or too far apart.
pub(crate) fn misspelling_distance(written: &str, known: &str) -> Option<usize> {
    let (length, known_length) = (written.chars().count(), known.chars().count());
    let allowed = if length >= 8 { 2 } else { 1 };
    let is_near = length >= 4
        && known_length >= 4
        && known_length.abs_diff(length) <= allowed
        && written.chars().next() == known.chars().next();
    is_near.then(|| strsim::osa_distance(written, known)).filter(|distance| *distance <= allowed)
}

#[cfg(test)]
mod tests {
    //! Contract: a thing is found under every ordinary way to say it, and alike things score higher than unlike ones.
    use super::*;

    fn name_of(knowledge: &Knowledge, name: &str) -> Option<String> {
        knowledge.find(name).map(|category| category.name.clone())
    }

    #[test]
    fn finds_case_plural_synonym_typo_and_head() {
        let knowledge = Knowledge::embedded().unwrap();
        let cases = [
            ("Apple", "apple"),
            ("couch", "sofa"),
            ("COUCHES", "sofa"),
            ("shelve", "shelf"),
            ("book-shelves", "bookshelf"),
            ("computer desk", "desk"),
            ("laptp", "laptop"),
            ("refridgerator", "fridge"),
            ("black leather armchair", "armchair"),
            ("bowl of soup", "bowl"),
            ("white cabinets", "cabinet"),
        ];
        for (said, meant) in cases {
            assert_eq!(name_of(&knowledge, said).as_deref(), Some(meant), "{said}");
        }
        for unknown in ["", "bad", "xylophone factory", "\u{1}\u{2}", "ddd"] {
            assert_eq!(name_of(&knowledge, unknown), None, "{unknown:?}");
        }
    }

    #[test]
    fn similarity_orders_same_kind_sibling_unlike() {
        let knowledge = Knowledge::embedded().unwrap();
        let same = knowledge.similarity("couch", "sofa");
        let kind = knowledge.similarity("armchair", "chair");
        let look_alike = knowledge.similarity("mug", "cup");
        let sibling = knowledge.similarity("apple", "banana");
        let unlike = knowledge.similarity("apple", "sofa");
        assert_eq!(same, 1.0);
        assert!(same > kind && kind > look_alike && look_alike > sibling && sibling > unlike);
        assert!(unlike < 0.1, "{unlike}");
        assert_eq!(knowledge.similarity("fruit", "apple"), 0.9);
        assert_eq!(knowledge.similarity("flurb", "flurbs"), 1.0);
        for (a, b) in [("apple", "pear"), ("mug", "fruit"), ("desk", "table")] {
            assert_eq!(knowledge.similarity(a, b), knowledge.similarity(b, a), "{a} {b}");
        }
    }
}
