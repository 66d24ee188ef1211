//! The loop of grounding.

use super::answer::{Grounding, ReferenceFrame};
use super::backend::Spoken;
use super::command::without_verb;
use super::config::{GroundConfig, GroundConfigError};
use super::decide::{self, Choice};
use super::filter::{self, Context};
use super::noun::Names;
use super::query::{Entity, Noun, Query, Viewpoint};
use super::reader::{EmbeddedReader, QueryReader, QueryText};
use super::referring::{Features, RankingWeights, features_of, find_mentions};
use super::retrieve;
use super::rooms;
use super::scene::Scene;
use super::scorer::RelationScorer;
use super::verify::{EmbeddedVerifier, Verifier};
use super::words::tokens_of;
use super::{Article, GroundingStatus};
use crate::Pose;
use crate::knowledge::Knowledge;
use crate::map::{Map, ObjectId};
use nalgebra::Vector2;
use std::collections::BTreeMap;
use std::sync::Arc;

/// Grounds referring expressions in a map.
pub struct Grounder {
    pub(super) config: GroundConfig,
    pub(super) knowledge: Arc<Knowledge>,
    pub(super) embedded_reader: EmbeddedReader,
    pub(super) embedded_verifier: EmbeddedVerifier,
    pub(super) reader: Option<Box<dyn QueryReader>>,
    pub(super) scorer: Option<Box<dyn RelationScorer>>,
    pub(super) verifier: Option<Box<dyn Verifier>>,
    weights: RankingWeights,
}

/// Evidence for each candidate of a text where the thing that is meant is known to be there.
#[derive(Clone, Debug, PartialEq)]
pub struct Ranking {
    /// The candidates.
    pub ids: Vec<ObjectId>,
    /// Evidence by name of [`RankingWeights::names`], one row per candidate.
    pub rows: Vec<Vec<f32>>,
}

impl Grounder {
    /// A grounder with the embedded reader and the embedded verifier.
    ///
    /// # Errors
    /// A parameter outside its range.
    pub fn new(config: GroundConfig, knowledge: Arc<Knowledge>) -> Result<Self, GroundConfigError> {
        config.validate()?;
        Ok(Self {
            config,
            embedded_reader: EmbeddedReader::new(Arc::clone(&knowledge)),
            embedded_verifier: EmbeddedVerifier::new(Arc::clone(&knowledge)),
            knowledge,
            reader: None,
            scorer: None,
            verifier: None,
            weights: RankingWeights::fitted(),
        })
    }

    /// Reads words by a plugged-in backend; the grammar reads what it leaves.
    pub fn with_reader(mut self, reader: Box<dyn QueryReader>) -> Self {
        self.reader = Some(reader);
        self
    }

    /// Has the relations of the best candidates scored by a plugged-in backend as well.
    pub fn with_scorer(mut self, scorer: Box<dyn RelationScorer>) -> Self {
        self.scorer = Some(scorer);
        self
    }

    /// Verifies candidates by a plugged-in backend; the embedded verifier looks where it does not.
    pub fn with_verifier(mut self, verifier: Box<dyn Verifier>) -> Self {
        self.verifier = Some(verifier);
        self
    }

    /// The same grounder by the embedded parts alone, for questions that come with every frame.
    pub fn without_backends(&self) -> Self {
        Self {
            config: self.config.clone(),
            embedded_reader: self.embedded_reader.clone(),
            embedded_verifier: self.embedded_verifier.clone(),
            knowledge: Arc::clone(&self.knowledge),
            reader: None,
            scorer: None,
            verifier: None,
            weights: self.weights.clone(),
        }
    }

    /// Replaces the weights of evidence, which count where the thing that is meant is known to be there.
    pub fn with_weights(mut self, weights: RankingWeights) -> Self {
        self.weights = weights;
        self
    }

    /// What the words mean in the map. `world_from_viewer` is the robot's base or camera: left, right, nearest and the
    /// like are its. A command's verb is skipped, so that "grasp the red apple" grounds the apple.
    pub fn ground(&self, map: &Map, text: &str, world_from_viewer: Option<&Pose>) -> Grounding {
        self.ground_with_fronts(map, &BTreeMap::new(), text, world_from_viewer)
    }

    /// As [`ground`](Self::ground), where the front of some objects is known: the direction in the world's floor plane
    /// in which it points. Left and right of such an object are those of a viewer who faces its front.
    pub fn ground_with_fronts(
        &self,
        map: &Map,
        fronts: &BTreeMap<ObjectId, [f64; 2]>,
        text: &str,
        world_from_viewer: Option<&Pose>,
    ) -> Grounding {
        let tokens = tokens_of(text);
        let words = without_verb(&tokens);
        let scene = Scene::new(map, &self.knowledge, world_from_viewer).with_fronts(fronts);
        let names = Names::of(scene.names.winning(), self.config.presume_present);
        let said = QueryText { text, words, names: &names };
        if self.config.presume_present && !words.is_empty() {
            return self.ground_present(scene, said);
        }
        let (readings, mut spoken) = self.read(&said);
        let mut readings = readings.into_iter();
        let Some(first) = readings.next() else {
            let reason = if tokens.is_empty() { "there are no words" } else { "no thing or room is named" };
            return Grounding::unparsed(reason).told_by(spoken);
        };
        let answer = self.answer(&scene, text, first);
        // Another reading counts only where the likeliest decides nothing.
        let other = if answer.status == GroundingStatus::Found { None } else { readings.next() };
        let other = other.map(|query| self.answer(&scene, text, query));
        let answer = other.filter(|other| other.status == GroundingStatus::Found).unwrap_or(answer);
        spoken.extend(answer.spoken.iter().cloned());
        answer.told_by(spoken)
    }

    /// As [`ground_with_fronts`](Self::ground_with_fronts), where the thing that is meant is known to be there.
    fn ground_present(&self, scene: Scene<'_>, said: QueryText<'_>) -> Grounding {
        let (scene, query, mut spoken) = self.understand(scene, said);
        let context = Context { scene: &scene, knowledge: &self.knowledge, config: &self.config };
        let (mut evaluation, features) = self.weigh(context, &query, said.words);
        evaluation.total.fill(0.0);
        for (item, share) in features.items.iter().zip(self.weights.rank(&features)) {
            evaluation.total[*item] = share;
        }
        let answer = self.decide(&scene, said.text, query, evaluation);
        spoken.extend(answer.spoken.iter().cloned());
        answer.told_by(spoken)
    }

    /// The evidence for each candidate of a text, before it is weighed; for fitting the weights.
    pub fn rank_evidence(&self, map: &Map, fronts: &BTreeMap<ObjectId, [f64; 2]>, text: &str) -> Ranking {
        let tokens = tokens_of(text);
        let words = without_verb(&tokens);
        let scene = Scene::new(map, &self.knowledge, None).with_fronts(fronts);
        let names = Names::of(scene.names.winning(), true);
        let (scene, query, _) = self.understand(scene, QueryText { text, words, names: &names });
        let context = Context { scene: &scene, knowledge: &self.knowledge, config: &self.config };
        let (_, features) = self.weigh(context, &query, words);
        Ranking {
            ids: features.items.iter().map(|item| scene.items[*item].object.id).collect(),
            rows: features.rows.iter().map(|row| row.to_vec()).collect(),
        }
    }

    /// The query, and the scene as seen from where the words place the viewer.
    fn understand<'a>(&self, scene: Scene<'a>, said: QueryText<'_>) -> (Scene<'a>, Query, Vec<Spoken>) {
        let anything = || Query { target: Entity::named(Noun::Anything), viewpoint: None };
        let (readings, spoken) = self.read(&said);
        let query = readings.into_iter().next().unwrap_or_else(anything);
        let query = self.with_known_noun(&scene, query, said.words, said.names);
        match self.faced(&scene, &query) {
            Some(forward) => (scene.facing(forward), query, spoken),
            None => (scene, query, spoken),
        }
    }

    fn weigh(&self, context: Context<'_, '_>, query: &Query, words: &[String]) -> (filter::Evaluation, Features) {
        let mentions = find_mentions(context.scene, &self.knowledge, words);
        let evaluation = filter::evaluate_with(context, &query.target, &mentions);
        let features = features_of(context, query, words, &mentions, &evaluation);
        (evaluation, features)
    }

    /// When nothing bears the target's name: the first thing that is named but no anchor, else anything.
    fn with_known_noun(&self, scene: &Scene<'_>, mut query: Query, words: &[String], names: &Names) -> Query {
        let fits = |noun: &Noun| retrieve::literal_noun_scores(scene, noun, &self.knowledge).iter().any(|s| *s > 0.0);
        if matches!(query.target.noun, Noun::Thing(_)) && fits(&query.target.noun) {
            return query;
        }
        // "the stall" where nothing is called so but a "bathroom stall".
        if let Noun::Thing(said) = &query.target.noun
            && let Some(fuller) = names.find_fuller(said)
        {
            query.target.noun = Noun::Thing(fuller.to_owned());
            return query;
        }
        let mut anchors = Vec::new();
        collect_anchors(&query.target, &mut anchors);
        let faced = match &query.viewpoint {
            Some(Viewpoint { at: Entity { noun: Noun::Thing(faced), .. }, .. }) => Some(faced.clone()),
            _ => None,
        };
        anchors.extend(faced.clone());
        let is_bound = |phrase: &str| matches!(phrase, "wall" | "walls" | "floor" | "ceiling" | "object" | "objects");
        let named = (0..words.len()).find_map(|start| {
            let ends = (start + 1..=words.len().min(start + 3)).rev();
            ends.map(|end| words[start..end].join(" ")).find(|phrase| {
                names.contain(phrase) && !is_bound(phrase) && !anchors.iter().any(|anchor| anchor == phrase)
            })
        });
        // "facing the cabinets, right" speaks of the cabinets.
        query.target.noun = named.or(faced).map_or(Noun::Anything, Noun::Thing);
        query
    }

    /// The direction in which a viewer looks who stands as the query says.
    fn faced(&self, scene: &Scene<'_>, query: &Query) -> Option<Vector2<f64>> {
        let viewpoint = query.viewpoint.as_ref()?;
        let context = Context { scene, knowledge: &self.knowledge, config: &self.config };
        let total = filter::evaluate(context, &viewpoint.at).total;
        let best = total.iter().copied().fold(0.0, f32::max);
        if best <= 0.0 {
            return None;
        }
        let likely: Vec<usize> = (0..total.len()).filter(|i| total[*i] >= 0.6 * best).collect();
        if let ([one], false) = (likely.as_slice(), viewpoint.entering)
            && let Some(front) = scene.fronts.get(&scene.items[*one].object.id)
        {
            return Some(-Vector2::new(front[0], front[1]));
        }
        let sum = likely.iter().map(|i| scene.items[*i].bounds.center().xy().coords).sum::<Vector2<f64>>();
        let forward = sum / likely.len() as f64 - scene.center.coords;
        let forward = if viewpoint.entering { -forward } else { forward };
        (forward.norm() > 0.3).then(|| forward.normalize())
    }

    fn answer(&self, scene: &Scene<'_>, text: &str, query: Query) -> Grounding {
        let context = Context { scene, knowledge: &self.knowledge, config: &self.config };
        if matches!(query.target.noun, Noun::Room(_)) {
            return self.answer_room(context, query);
        }
        // Stages 1 and 2: retrieval and the relation filter.
        let evaluation = filter::evaluate(context, &query.target);
        self.decide(scene, text, query, evaluation)
    }

    fn decide(&self, scene: &Scene<'_>, text: &str, query: Query, evaluation: filter::Evaluation) -> Grounding {
        let mut choices = decide::best_choices(&evaluation, self.config.top_k);
        let all: Vec<usize> = choices.iter().map(|choice| choice.index).collect();
        choices.retain(|choice| !all.iter().any(|other| scene.is_double(choice.index, *other, &self.knowledge)));
        let mut spoken = Vec::new();
        spoken.extend(self.score_relations(scene, text, &query, &mut choices));
        // Stage 3: verification of the top k in views.
        if self.config.verify {
            spoken.extend(self.verify(scene, text, &query, &mut choices));
        }
        let settled = decide::settle(&choices, query.target.article == Article::Indefinite, &self.config, |choice| {
            let (eye, _) = scene.standpoint();
            (scene.items[choice.index].bounds.center().xy() - eye).norm()
        });
        let object_of = |choice: &Choice| (Some(scene.items[choice.index].object.id), None);
        decide::grounding(settled, choices, object_of, evaluation.frame, query).told_by(spoken)
    }

    fn answer_room(&self, context: Context<'_, '_>, query: Query) -> Grounding {
        let mut frame = ReferenceFrame::None;
        let rooms = &context.scene.map.rooms;
        let factors = rooms::evaluate(context, &query.target, &mut frame);
        let choices = decide::best_rooms(&factors, rooms.len());
        let any = query.target.article == Article::Indefinite;
        let settled = decide::settle(&choices, any, &self.config, |choice| {
            (rooms[choice.index].center - context.scene.standpoint().0).norm()
        });
        let room_of = |choice: &Choice| (None, Some(rooms[choice.index].id));
        decide::grounding(settled, choices, room_of, frame, query)
    }
}

/// The names of all anchors.
fn collect_anchors(entity: &Entity, names: &mut Vec<String>) {
    for anchor in entity.relations.iter().flat_map(|relation| &relation.anchors) {
        if let Noun::Thing(name) = &anchor.noun {
            names.push(name.clone());
        }
        collect_anchors(anchor, names);
    }
}
