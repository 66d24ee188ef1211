//! Referring expressions made from the truth of a scene, each with what it means.
//!
//! For every seen thing, every kind of words that tells it apart from all other things of its name, with a margin, gives
//! one expression in one of several wordings. Other things of its name are those that an ordinary listener could take for
//! it ([`Knowledge::similarity`] from 0.5), seen or not. Absent things, and names alone where several things bear them,
//! are asked for as well.

use super::rooms::contains;
use super::scene::{TrueScene, TrueThing};
use crate::geometry::Aabb;
use crate::knowledge::Knowledge;
use rand::seq::SliceRandom;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};

/// Things with names this alike may be taken for each other.
const ALIKE: f32 = 0.5;
/// A thing within this distance of another is beside it, metres; its rivals are at least [`APART_M`] away.
const BESIDE_M: f64 = 0.45;
/// Rivals of what is beside something are at least this far from it, metres.
const APART_M: f64 = 1.5;
/// The closest is closer than the next by at least this, metres.
const CLOSER_M: f64 = 0.5;
/// The largest is larger than the next by at least this factor.
const LARGER: f64 = 1.6;
/// Most expressions of one kind in one scene.
const MOST_PER_KIND: usize = 8;

/// What an expression means.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Meant {
    /// This thing of the scene.
    Thing(usize),
    /// Nothing that is there.
    Absent,
    /// One of several, and it does not say which.
    Ambiguous,
}

/// Words with what they mean.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Expression {
    /// The words.
    pub text: String,
    /// What they mean.
    pub meant: Meant,
    /// What tells the thing apart: `name`, `color`, `material`, `on`, ...
    pub kind: String,
    /// Whether other things bear its name.
    pub multiple: bool,
}

/// The truth with boxes at hand.
struct View<'a> {
    things: &'a [TrueThing],
    boxes: Vec<Aabb>,
    alike: Vec<Vec<usize>>,
    truth: &'a TrueScene,
}

/// Makes the expressions of a scene; the same for the same scene and seed.
pub fn make_expressions(truth: &TrueScene, knowledge: &Knowledge, seed: u64) -> Vec<Expression> {
    let things = &truth.objects;
    let alike_to = |i: usize| -> Vec<usize> {
        let alike = |j: &usize| *j != i && knowledge.similarity(&things[i].category, &things[*j].category) >= ALIKE;
        (0..things.len()).filter(alike).collect()
    };
    let view = View {
        things,
        boxes: things.iter().map(|thing| thing.bounds.aabb()).collect(),
        alike: (0..things.len()).map(alike_to).collect(),
        truth,
    };
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut made: Vec<(String, Expression)> = Vec::new();
    for i in (0..things.len()).filter(|i| things[*i].is_seen()) {
        for (kind, phrase) in view.describe(i) {
            let multiple = !view.alike[i].is_empty();
            let text = reword(&phrase, &things[i].category, knowledge, &mut rng);
            let expression = Expression { text, meant: Meant::Thing(i), kind: kind.to_owned(), multiple };
            made.push((kind.to_owned(), expression));
        }
    }
    made.extend(view.absent(knowledge, &mut rng).into_iter().map(|expression| (expression.kind.clone(), expression)));
    for i in (0..things.len()).filter(|i| things[*i].is_seen()) {
        // Said once per name, by its first bearer; two that can be seen leave it open.
        let seen = view.alike[i].iter().filter(|j| things[**j].category == things[i].category && things[**j].is_seen());
        let others: Vec<usize> = seen.copied().collect();
        if others.first().is_some_and(|first| i < *first) {
            let text = format!("the {}", things[i].category);
            let expression = Expression { text, meant: Meant::Ambiguous, kind: "ambiguous".to_owned(), multiple: true };
            made.push(("ambiguous".to_owned(), expression));
        }
    }
    // Not more of one kind than of the others: the rest is left out by lot.
    made.shuffle(&mut rng);
    made.sort_by(|a, b| a.0.cmp(&b.0));
    let chosen = made.chunk_by(|a, b| a.0 == b.0).flat_map(|chunk| chunk.iter().take(MOST_PER_KIND));
    chosen.map(|(_, expression)| expression.clone()).collect()
}

impl View<'_> {
    /// Phrases that mean thing `i` and no other, with their kinds. `{}` stands for its name.
    fn describe(&self, i: usize) -> Vec<(&'static str, String)> {
        let rivals = &self.alike[i];
        let mut phrases = Vec::new();
        if rivals.is_empty() {
            phrases.push(("name", "the {}".to_owned()));
        }
        // Words that say more than is needed are said of what is alone as well, but tell nothing: left out.
        if rivals.is_empty() {
            return phrases;
        }
        let attributes = |j: usize| &self.things[j].attributes;
        let told = |of: &dyn Fn(usize) -> Option<String>| -> Option<String> {
            let own = of(i)?;
            rivals.iter().all(|j| of(*j).is_some_and(|other| other != own)).then_some(own)
        };
        let color = |j: usize| attributes(j).color.clone().filter(|color| color != "multicolored");
        if let Some(color) = told(&color) {
            phrases.push(("color", format!("the {color} {{}}")));
        }
        let material = |j: usize| attributes(j).material.clone();
        if let Some(material) = told(&material) {
            phrases.push(("material", format!("the {material} {{}}")));
        }
        let pattern = |j: usize| Some(attributes(j).pattern.clone().unwrap_or_else(|| "plain".to_owned()));
        if let Some(pattern) = told(&pattern).filter(|pattern| pattern != "plain") {
            phrases.push(("pattern", format!("the {pattern} {{}}")));
        }
        // Of all rivals but one colour: "the one that is not red".
        if let Some(own) = color(i) {
            let others: Vec<Option<String>> = rivals.iter().map(|j| color(*j)).collect();
            if let Some(Some(first)) = others.first()
                && *first != own
                && others.iter().all(|other| other.as_ref() == Some(first))
            {
                phrases.push(("negation", format!("the {{}} that is not {first}")));
            }
        }
        let volume = |j: usize| self.boxes[j].size().product().max(1e-9).cbrt();
        if rivals.iter().all(|j| volume(i) > LARGER.cbrt() * volume(*j)) {
            phrases.push(("size", "the largest {}".to_owned()));
        } else if rivals.iter().all(|j| LARGER.cbrt() * volume(i) < volume(*j)) {
            phrases.push(("size", "the smallest {}".to_owned()));
        }
        if let Some(room) = self.room_of(i).filter(|room| rivals.iter().all(|j| self.room_of(*j) != Some(room))) {
            phrases.push(("room", format!("the {{}} in the {room}")));
        }
        phrases.extend(self.relate(i));
        phrases
    }

    fn relate(&self, i: usize) -> Vec<(&'static str, String)> {
        let rivals = &self.alike[i];
        let mut phrases = Vec::new();
        let anchors = (0..self.things.len()).filter(|a| *a != i && !rivals.contains(a) && self.things[*a].is_seen());
        for a in anchors {
            let name = &self.things[a].category;
            // Every bearer of the anchor's name counts: "on a table" must hold of no rival at any table.
            let bearers: Vec<usize> = [vec![a], self.alike[a].clone()].concat();
            let only = |holds: &dyn Fn(usize, usize) -> bool, apart: &dyn Fn(usize, usize) -> bool| {
                holds(i, a) && rivals.iter().all(|j| bearers.iter().all(|b| apart(*j, *b)))
            };
            let on = |j: usize, b: usize| self.rests_on(j, b);
            if only(&on, &|j, b| !self.nearly_on(j, b)) {
                phrases.push(("on", format!("the {{}} on the {name}")));
            }
            if only(&|j, b| self.is_under(j, b), &|j, b| !self.is_under(j, b)) {
                phrases.push(("under", format!("the {{}} under the {name}")));
            }
            let gap = |j: usize, b: usize| self.gap_m(j, b);
            let level = !self.nearly_on(i, a) && !self.nearly_on(a, i);
            if level && only(&|j, b| gap(j, b) < BESIDE_M, &|j, b| gap(j, b) > APART_M) {
                phrases.push(("next_to", format!("the {{}} next to the {name}")));
            } else if bearers.len() == 1 && rivals.iter().all(|j| gap(i, a) + CLOSER_M < gap(*j, a)) && gap(i, a) < 3.0
            {
                phrases.push(("closest", format!("the {{}} closest to the {name}")));
            }
        }
        phrases.truncate(4);
        phrases
    }

    fn room_of(&self, i: usize) -> Option<&str> {
        let place = self.boxes[i].center().xy();
        let room = self.truth.rooms.iter().find(|room| contains(&room.polygon, &place))?;
        Some(room.name.as_str())
    }

    fn gap_m(&self, a: usize, b: usize) -> f64 {
        let (a, b) = (&self.boxes[a], &self.boxes[b]);
        let side = |k: usize| (a.min[k] - b.max[k]).max(b.min[k] - a.max[k]).max(0.0);
        side(0).hypot(side(1)).hypot(side(2))
    }

    /// Its middle is over the other, and its lower end at the other's top or within its height when that is a shelf.
    fn rests_on(&self, a: usize, b: usize) -> bool {
        let (own, support) = (&self.boxes[a], &self.boxes[b]);
        let middle = own.center();
        let over = (0..2).all(|k| middle[k] > support.min[k] && middle[k] < support.max[k]);
        over && (own.min.z - support.max.z).abs() < 0.05
    }

    fn nearly_on(&self, a: usize, b: usize) -> bool {
        let (own, support) = (&self.boxes[a], &self.boxes[b]);
        let near = (0..2).all(|k| own.max[k] > support.min[k] - 0.1 && own.min[k] < support.max[k] + 0.1);
        near && own.min.z > support.min.z + 0.05 && own.min.z < support.max.z + 0.2
    }

    fn is_under(&self, a: usize, b: usize) -> bool {
        let (own, roof) = (&self.boxes[a], &self.boxes[b]);
        let middle = own.center();
        let below = (0..2).all(|k| middle[k] > roof.min[k] && middle[k] < roof.max[k]);
        below && own.max.z < roof.max.z - 0.05 && own.min.z < roof.min.z + 0.1
    }

    /// Names that nothing bears, and colours and places that no bearer of a name has.
    fn absent(&self, knowledge: &Knowledge, rng: &mut ChaCha8Rng) -> Vec<Expression> {
        let absent =
            |text: String, multiple| Expression { text, meant: Meant::Absent, kind: "absent".to_owned(), multiple };
        let mut made = Vec::new();
        let mut names: Vec<&str> = knowledge
            .categories()
            .iter()
            .filter(|category| !category.is_a("structure"))
            .map(|category| category.name.as_str())
            .filter(|name| self.things.iter().all(|thing| knowledge.similarity(name, &thing.category) < ALIKE))
            .collect();
        names.shuffle(rng);
        made.extend(names.into_iter().take(4).map(|name| absent(format!("the {name}"), false)));
        let colors = ["red", "green", "blue", "yellow", "purple", "black"];
        let mut seen: Vec<usize> = (0..self.things.len()).filter(|i| self.things[*i].is_seen()).collect();
        seen.shuffle(rng);
        for i in seen.into_iter().take(12) {
            let bearers: Vec<usize> = [vec![i], self.alike[i].clone()].concat();
            let known: Vec<Option<&String>> =
                bearers.iter().map(|j| self.things[*j].attributes.color.as_ref()).collect();
            let color = colors[rng.random_range(0..colors.len())];
            let unlike = |other: &Option<&String>| other.is_some_and(|other| far_apart(color, other));
            if known.iter().all(unlike) && made.len() < MOST_PER_KIND {
                made.push(absent(format!("the {color} {}", self.things[i].category), bearers.len() > 1));
            }
        }
        made
    }
}

/// Colours that nobody takes for each other.
fn far_apart(a: &str, b: &str) -> bool {
    const NEIGHBOURS: [(&str, &[&str]); 6] = [
        ("red", &["red", "orange", "pink", "brown", "purple", "multicolored"]),
        ("green", &["green", "cyan", "yellow", "teal", "multicolored"]),
        ("blue", &["blue", "cyan", "purple", "black", "gray", "multicolored"]),
        ("yellow", &["yellow", "orange", "beige", "green", "brown", "white", "multicolored"]),
        ("purple", &["purple", "pink", "blue", "red", "black", "multicolored"]),
        ("black", &["black", "gray", "brown", "blue", "purple", "green", "multicolored"]),
    ];
    NEIGHBOURS.iter().find(|(color, _)| *color == a).is_some_and(|(_, near)| !near.contains(&b))
}

/// One of several wordings; one in four says a synonym of the name.
fn reword(phrase: &str, category: &str, knowledge: &Knowledge, rng: &mut ChaCha8Rng) -> String {
    let synonyms = knowledge.find_exact(category).map_or(&[][..], |category| &category.synonyms);
    let name = match synonyms.len() {
        0 => category,
        count if rng.random_bool(0.25) => synonyms[rng.random_range(0..count.min(2))].as_str(),
        _ => category,
    };
    let said = phrase.replace("{}", name);
    let variants: &[(&str, &[&str])] = &[
        (" on the ", &[" on the ", " that is on the ", " on top of the ", " lying on the "]),
        (" under the ", &[" under the ", " beneath the ", " that is under the "]),
        (" next to the ", &[" next to the ", " beside the ", " that stands next to the "]),
        (" closest to the ", &[" closest to the ", " nearest to the ", " that is closest to the "]),
        (" in the ", &[" in the ", " that is in the "]),
    ];
    let found = variants.iter().find(|(plain, _)| said.contains(plain));
    let worded = match found {
        Some((plain, ways)) => said.replacen(plain, ways[rng.random_range(0..ways.len())], 1),
        None => said,
    };
    let openings = ["", "", "find ", "please find ", "grasp ", "where is "];
    format!("{}{worded}", openings[rng.random_range(0..openings.len())])
}

#[cfg(test)]
mod tests {
    //! Contract: expressions are true of what they mean and of nothing else, and the same seed gives the same ones.
    use super::*;
    use crate::eval::TrueAttributes;
    use crate::geometry::OrientedBox;
    use nalgebra::Point3;

    fn thing(category: &str, color: &str, center: [f64; 3], size: [f64; 3]) -> TrueThing {
        let half = nalgebra::Vector3::from(size) * 0.5;
        let bounds = Aabb { min: Point3::from(center) - half, max: Point3::from(center) + half };
        let attributes = TrueAttributes { color: Some(color.to_owned()), ..TrueAttributes::default() };
        TrueThing {
            category: category.to_owned(),
            attributes,
            bounds: OrientedBox::from(bounds),
            points: Vec::new(),
            frames_seen: 9,
        }
    }

    fn scene() -> TrueScene {
        TrueScene {
            name: "test".to_owned(),
            rooms: Vec::new(),
            objects: vec![
                thing("table", "brown", [0.0, 0.0, 0.375], [1.4, 0.8, 0.75]),
                thing("mug", "red", [0.2, 0.0, 0.8], [0.1, 0.1, 0.1]),
                thing("mug", "blue", [5.0, 0.0, 0.05], [0.1, 0.1, 0.1]),
                thing("sofa", "gray", [5.0, 1.0, 0.4], [2.0, 0.9, 0.8]),
            ],
        }
    }

    #[test]
    fn what_tells_things_apart_is_said() {
        let knowledge = Knowledge::embedded().unwrap();
        let made = make_expressions(&scene(), &knowledge, 1);
        assert_eq!(made, make_expressions(&scene(), &knowledge, 1));
        let kinds_of =
            |meant: Meant| -> Vec<&str> { made.iter().filter(|e| e.meant == meant).map(|e| e.kind.as_str()).collect() };
        for kind in ["color", "negation", "on"] {
            assert!(kinds_of(Meant::Thing(1)).contains(&kind), "{kind}: {made:#?}");
        }
        assert!(!kinds_of(Meant::Thing(2)).contains(&"on"), "{made:#?}");
        assert_eq!(kinds_of(Meant::Thing(0)), ["name"]);
        assert_eq!(kinds_of(Meant::Ambiguous), ["ambiguous"]);
        assert!(!kinds_of(Meant::Absent).is_empty());
        for absent in made.iter().filter(|e| e.meant == Meant::Absent) {
            assert!(!["the red mug", "the blue mug", "the table"].contains(&absent.text.as_str()), "{}", absent.text);
        }
    }
}
