//! Referring expressions made from the truth of a scene, each with what it means.
//!
//! For every seen thing, every kind of words that tells it apart from all its rivals, with a margin, gives expressions in
//! several wordings. Rivals are the things that its name can be said of ([`Knowledge::similarity`] from 0.75: the same name
//! or a kind of it), seen or not. Something is only said when one who stands in the scene would see it: colours and
//! materials that nobody takes for each other, sizes and distances with a margin, places by surfaces that touch or cover
//! ([`super::places`]). Absent things, and names alone where several things bear them, are asked for as well.

use super::places::Places;
use super::rooms::contains;
use super::scene::{TrueScene, TrueThing};
use crate::geometry::Aabb;
use crate::knowledge::Knowledge;
use rand::seq::SliceRandom;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};

/// From this likeness of names on, the name of one thing can be said of the other: the same, a synonym, a kind of it.
const SAME_NAME: f32 = 0.75;
/// What is absent has no name this much like that of anything there.
const ALIKE: f32 = 0.5;
/// The largest is larger than the next by at least this factor in volume: a quarter longer on every side, which one sees from
/// afar.
const LARGER: f64 = 2.0;
/// The tallest is taller than the next by at least this factor, of at least [`TALLER_M`].
const TALLER: f64 = 1.25;
/// Least difference of heights that is said, metres.
const TALLER_M: f64 = 0.1;
/// The highest stands higher than the next by at least this, metres.
const HIGHER_M: f64 = 0.4;
/// Most expressions of one kind in one scene.
const MOST_PER_KIND: usize = 8;
/// Most expressions of one thing, so that no single thing decides.
const MOST_PER_THING: usize = 4;

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
    /// Whether others were seen that bear its name.
    pub multiple: bool,
}

/// The truth with what is asked of it often.
struct View<'a> {
    things: &'a [TrueThing],
    boxes: Vec<Aabb>,
    rivals: Vec<Vec<usize>>,
    truth: &'a TrueScene,
}

/// Makes the expressions of a scene; the same for the same scene and seed.
pub fn make_expressions(truth: &TrueScene, knowledge: &Knowledge, seed: u64) -> Vec<Expression> {
    let things = &truth.objects;
    let rivals_of = |i: usize| -> Vec<usize> {
        let same = |j: &usize| *j != i && knowledge.similarity(&things[i].category, &things[*j].category) >= SAME_NAME;
        (0..things.len()).filter(same).collect()
    };
    let view = View {
        things,
        boxes: things.iter().map(|thing| thing.bounds.aabb()).collect(),
        rivals: (0..things.len()).map(rivals_of).collect(),
        truth,
    };
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let places = Places { truth, boxes: &view.boxes, rivals: &view.rivals };
    let mut made: Vec<Expression> = Vec::new();
    for i in (0..things.len()).filter(|i| things[*i].is_seen()) {
        let mut phrases = view.describe(i);
        if !view.rivals[i].is_empty() {
            phrases.extend(places.describe(i, &mut rng));
        }
        phrases.shuffle(&mut rng);
        let multiple = view.rivals[i].iter().any(|j| things[*j].is_seen());
        for (kind, phrase) in phrases.into_iter().take(MOST_PER_THING) {
            let text = view.reword(&phrase, i, knowledge, &mut rng);
            made.push(Expression { text, meant: Meant::Thing(i), kind: kind.to_owned(), multiple });
        }
    }
    made.extend(view.absent(knowledge, &mut rng));
    for i in (0..things.len()).filter(|i| things[*i].is_seen()) {
        // Said once per name, by its first bearer; two that can be seen leave it open.
        let seen =
            view.rivals[i].iter().filter(|j| things[**j].category == things[i].category && things[**j].is_seen());
        let others: Vec<usize> = seen.copied().collect();
        if others.first().is_some_and(|first| i < *first) {
            let text = format!("the {}", things[i].category);
            made.push(Expression { text, meant: Meant::Ambiguous, kind: "ambiguous".to_owned(), multiple: true });
        }
    }
    // Not more of one kind than of the others: the rest is left out by lot.
    made.shuffle(&mut rng);
    made.sort_by(|a, b| a.kind.cmp(&b.kind));
    let chosen = made.chunk_by(|a, b| a.kind == b.kind).flat_map(|chunk| chunk.iter().take(MOST_PER_KIND));
    chosen.cloned().collect()
}

impl View<'_> {
    /// Phrases that tell thing `i` from its rivals by what it is like or the room it is in, with their kinds. `{}` stands
    /// for its name.
    fn describe(&self, i: usize) -> Vec<(&'static str, String)> {
        let rivals = &self.rivals[i];
        // Words that say more than is needed are said of what is alone as well, but tell nothing: left out.
        if rivals.is_empty() {
            return vec![("name", "the {}".to_owned())];
        }
        let mut phrases = Vec::new();
        let attributes = |j: usize| &self.things[j].attributes;
        let told = |of: &dyn Fn(usize) -> Option<String>, differ: &dyn Fn(&str, &str) -> bool| -> Option<String> {
            let own = of(i)?;
            rivals.iter().all(|j| of(*j).is_some_and(|other| differ(&own, &other))).then_some(own)
        };
        let color = |j: usize| attributes(j).color.clone().filter(|color| color != "multicolored");
        let own_color = told(&color, &differ_in_color);
        if let Some(color) = &own_color {
            phrases.push(("color", format!("the {color} {{}}")));
        }
        let material = |j: usize| attributes(j).material.clone();
        if let Some(material) = told(&material, &differ_in_material) {
            phrases.push(("material", format!("the {material} {{}}")));
        }
        // Grain is what makes people say "wooden".
        let pattern = |j: usize| Some(attributes(j).pattern.clone().unwrap_or_else(|| "plain".to_owned()));
        if let Some(pattern) =
            told(&pattern, &|a, b| a != b).filter(|pattern| !matches!(pattern.as_str(), "plain" | "wood grain"))
        {
            phrases.push(("pattern", format!("the {pattern} {{}}")));
        }
        // All rivals have one colour: "the one that is not red".
        let others: Vec<Option<String>> = rivals.iter().map(|j| color(*j)).collect();
        if let (Some(_), Some(Some(first))) = (&own_color, others.first())
            && others.iter().all(|other| other.as_ref() == Some(first))
        {
            phrases.push(("negation", format!("the {{}} that is not {first}")));
        }
        let beats =
            |first: f64, second: f64, factor: f64, least: f64| first > factor * second && first > second + least;
        let volume = |j: usize| self.boxes[j].size().product().max(1e-9);
        let height = |j: usize| self.boxes[j].size().z;
        let place = |j: usize| self.boxes[j].center().z;
        let all = |holds: &dyn Fn(usize) -> bool| rivals.iter().all(|j| holds(*j));
        if all(&|j| beats(volume(i), volume(j), LARGER, 0.0)) {
            phrases.push(("size", "the largest {}".to_owned()));
        } else if all(&|j| beats(volume(j), volume(i), LARGER, 0.0)) {
            phrases.push(("size", "the smallest {}".to_owned()));
        } else if all(&|j| beats(height(i), height(j), TALLER, TALLER_M)) {
            phrases.push(("size", "the tallest {}".to_owned()));
        }
        if all(&|j| place(i) > place(j) + HIGHER_M) {
            phrases.push(("height", "the highest {}".to_owned()));
        } else if all(&|j| place(i) + HIGHER_M < place(j)) {
            phrases.push(("height", "the lowest {}".to_owned()));
        }
        if let Some(room) = self.room_of(i).filter(|room| rivals.iter().all(|j| self.room_of(*j) != Some(room))) {
            phrases.push(("room", format!("the {{}} in the {room}")));
        }
        phrases
    }

    fn room_of(&self, i: usize) -> Option<&str> {
        let place = self.boxes[i].center().xy();
        let room = self.truth.rooms.iter().find(|room| contains(&room.polygon, &place))?;
        Some(room.name.as_str())
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
            let bearers: Vec<usize> = [vec![i], self.rivals[i].clone()].concat();
            let known: Vec<Option<&String>> =
                bearers.iter().map(|j| self.things[*j].attributes.color.as_ref()).collect();
            let color = colors[rng.random_range(0..colors.len())];
            let unlike = |other: &Option<&String>| other.is_some_and(|other| differ_in_color(color, other));
            if known.iter().all(unlike) && made.len() < MOST_PER_KIND {
                made.push(absent(format!("the {color} {}", self.things[i].category), bearers.len() > 1));
            }
        }
        made
    }
    /// One of several wordings; one in four says a synonym of the name that can be said of nothing else.
    fn reword(&self, phrase: &str, i: usize, knowledge: &Knowledge, rng: &mut ChaCha8Rng) -> String {
        let category = self.things[i].category.as_str();
        let strange = |j: &usize| *j != i && !self.rivals[i].contains(j);
        let means_it = |synonym: &&String| {
            let others = (0..self.things.len()).filter(strange);
            knowledge.similarity(synonym, category) >= 0.99
                && others.into_iter().all(|j| knowledge.similarity(synonym, &self.things[j].category) < SAME_NAME)
        };
        let synonyms: Vec<&String> = match knowledge.find_exact(category) {
            Some(known) => known.synonyms.iter().take(2).filter(means_it).collect(),
            None => Vec::new(),
        };
        let name = match synonyms.len() {
            0 => category,
            count if rng.random_bool(0.25) => synonyms[rng.random_range(0..count)].as_str(),
            _ => category,
        };
        let said = phrase.replace("{}", name);
        let found = WORDINGS.iter().find(|(plain, _)| said.contains(plain));
        let worded = match found {
            Some((plain, ways)) => said.replacen(plain, ways[rng.random_range(0..ways.len())], 1),
            None => said,
        };
        let openings = ["", "", "find ", "please find ", "grasp ", "where is "];
        format!("{}{worded}", openings[rng.random_range(0..openings.len())])
    }
}

/// Ways to say the same.
const WORDINGS: [(&str, &[&str]); 10] = [
    (" with the ", &[" with the ", " that has the "]),
    (" on the ", &[" on the ", " that is on the ", " on top of the ", " lying on the "]),
    (" under the ", &[" under the ", " beneath the ", " that is under the "]),
    (" above the ", &[" above the ", " that is above the ", " over the "]),
    (" next to the ", &[" next to the ", " beside the ", " that stands next to the "]),
    (" closest to the ", &[" closest to the ", " nearest to the ", " that is closest to the "]),
    (" farthest from the ", &[" farthest from the ", " that is farthest from the ", " furthest from the "]),
    (" between the ", &[" between the ", " that is between the ", " in between the "]),
    (" of the ", &[" of the "]),
    (" in the ", &[" in the ", " that is in the ", " inside the "]),
];

/// Colours that nobody takes for each other, whatever the light.
fn differ_in_color(a: &str, b: &str) -> bool {
    /// Neighbours among the basic colour words.
    const NEIGHBOURS: [(&str, &[&str]); 13] = [
        ("red", &["orange", "pink", "brown", "purple"]),
        ("orange", &["red", "yellow", "brown", "pink", "beige"]),
        ("yellow", &["orange", "beige", "green", "brown", "white"]),
        ("green", &["yellow", "cyan", "black", "gray"]),
        ("cyan", &["green", "blue"]),
        ("blue", &["cyan", "purple", "black", "gray"]),
        ("purple", &["blue", "pink", "red", "black"]),
        ("pink", &["purple", "red", "orange", "beige"]),
        ("brown", &["red", "orange", "yellow", "black", "beige", "gray"]),
        ("beige", &["white", "yellow", "brown", "gray", "orange", "pink"]),
        ("white", &["beige", "gray", "yellow"]),
        ("gray", &["white", "black", "blue", "brown", "beige", "green"]),
        ("black", &["gray", "brown", "blue", "purple", "green"]),
    ];
    let near = NEIGHBOURS.iter().find(|(color, _)| *color == a).map(|(_, near)| near);
    near.is_some_and(|near| a != b && !near.contains(&b) && NEIGHBOURS.iter().any(|(color, _)| *color == b))
}

/// Materials that one tells apart by looking: painted plastic, ceramic and stone may look the same, metal and wood do not.
fn differ_in_material(a: &str, b: &str) -> bool {
    /// What may look the same; everything else differs.
    const SIMILAR: [&[&str]; 5] = [
        &["plastic", "ceramic", "rubber", "stone", "foam", "organic"],
        &["plastic", "glass"],
        &["paper", "cardboard", "plastic", "fabric"],
        &["fabric", "leather", "foam", "rubber"],
        &["wood", "wicker", "cardboard", "organic"],
    ];
    a != b && SIMILAR.iter().all(|group| !(group.contains(&a) && group.contains(&b)))
}

#[cfg(test)]
mod tests {
    //! Contract: expressions are true of what they mean and of nothing else, and the same seed gives the same ones.
    use super::*;
    use crate::eval::{SurfacePoint, TrueAttributes};
    use crate::geometry::OrientedBox;
    use nalgebra::Point3;
    use std::collections::BTreeSet;

    fn thing(category: &str, color: &str, center: [f64; 3], size: [f64; 3]) -> TrueThing {
        let half = nalgebra::Vector3::from(size) * 0.5;
        let bounds = Aabb { min: Point3::from(center) - half, max: Point3::from(center) + half };
        let attributes = TrueAttributes { color: Some(color.to_owned()), ..TrueAttributes::default() };
        TrueThing {
            category: category.to_owned(),
            attributes,
            bounds: OrientedBox::from(bounds),
            points: surface_of(&bounds),
            frames_seen: 9,
        }
    }

    /// The faces of a box.
    fn surface_of(bounds: &Aabb) -> Vec<SurfacePoint> {
        let mut points = Vec::new();
        for (axis, sign) in (0..3).flat_map(|axis| [(axis, -1.0), (axis, 1.0)]) {
            for (i, j) in (0..=20).flat_map(|i| (0..=20).map(move |j| (f64::from(i) / 20.0, f64::from(j) / 20.0))) {
                let mut share = nalgebra::Vector3::repeat(if sign > 0.0 { 1.0 } else { 0.0 });
                (share[(axis + 1) % 3], share[(axis + 2) % 3]) = (i, j);
                let position = (bounds.min + share.component_mul(&bounds.size())).cast();
                let mut normal = nalgebra::Vector3::zeros();
                normal[axis] = sign as f32;
                points.push(SurfacePoint { position, normal, area_m2: 0.001, seen: true });
            }
        }
        points
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
        assert_eq!(make_expressions(&scene(), &knowledge, 1), make_expressions(&scene(), &knowledge, 1));
        // Which of all that can be said is said goes by lot.
        let made: Vec<Expression> = (0..20).flat_map(|seed| make_expressions(&scene(), &knowledge, seed)).collect();
        let kinds_of = |meant: Meant| -> BTreeSet<&str> {
            made.iter().filter(|e| e.meant == meant).map(|e| e.kind.as_str()).collect()
        };
        for kind in ["color", "negation", "on", "height", "farthest"] {
            assert!(kinds_of(Meant::Thing(1)).contains(&kind), "{kind}: {made:#?}");
        }
        let of_one = |meant| make_expressions(&scene(), &knowledge, 3).iter().filter(|e| e.meant == meant).count();
        assert!(of_one(Meant::Thing(1)) <= MOST_PER_THING);
        assert!(!kinds_of(Meant::Thing(2)).contains(&"on"), "{made:#?}");
        assert_eq!(kinds_of(Meant::Thing(0)), BTreeSet::from(["name"]));
        assert_eq!(kinds_of(Meant::Ambiguous), BTreeSet::from(["ambiguous"]));
        assert!(!kinds_of(Meant::Absent).is_empty());
        for absent in made.iter().filter(|e| e.meant == Meant::Absent) {
            assert!(!["the red mug", "the blue mug", "the table"].contains(&absent.text.as_str()), "{}", absent.text);
        }
    }
}
