//! The loop of grounding.

use super::answer::{Grounding, ReferenceFrame};
use super::command::without_verb;
use super::config::{GroundConfig, GroundConfigError};
use super::decide::{self, Choice};
use super::filter::{self, Context};
use super::noun::Names;
use super::parse::{Attachment, parse_query};
use super::query::{Entity, Noun, Query, Viewpoint};
use super::referring::{Features, RankingWeights, features_of, find_mentions};
use super::retrieve;
use super::rooms;
use super::scene::Scene;
use super::verify::{EmbeddedVerifier, Evidence, Verdict, Verifier};
use super::views::CandidateViews;
use super::words::tokens_of;
use super::{Article, GroundingStatus};
use crate::Pose;
use crate::knowledge::Knowledge;
use crate::map::{Map, ObjectId};
use crate::raster::Renderer;
use nalgebra::Vector2;
use std::collections::BTreeMap;
use std::sync::Arc;

/// Grounds referring expressions in a map.
pub struct Grounder {
    config: GroundConfig,
    knowledge: Arc<Knowledge>,
    verifier: Box<dyn Verifier>,
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
    /// A grounder with the embedded verifier.
    ///
    /// # Errors
    /// A parameter outside its range.
    pub fn new(config: GroundConfig, knowledge: Arc<Knowledge>) -> Result<Self, GroundConfigError> {
        config.validate()?;
        let verifier = Box::new(EmbeddedVerifier::new(Arc::clone(&knowledge)));
        Ok(Self { config, knowledge, verifier, weights: RankingWeights::fitted() })
    }

    /// Replaces the verifier, for example by one that asks a vision-language model.
    pub fn with_verifier(mut self, verifier: Box<dyn Verifier>) -> Self {
        self.verifier = verifier;
        self
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
        if self.config.presume_present && !words.is_empty() {
            return self.ground_present(scene, words, &names);
        }
        let Some(near) = parse_query(words, &self.knowledge, &names, Attachment::Nearest) else {
            let reason = if tokens.is_empty() { "there are no words" } else { "no thing or room is named" };
            return Grounding::unparsed(reason, self.verifier.name());
        };
        let answer = self.answer(&scene, near.clone());
        if answer.status == GroundingStatus::Found {
            return answer;
        }
        // "the cup on the table next to the window": when the table's window decides nothing, it may be the cup's.
        match parse_query(words, &self.knowledge, &names, Attachment::Target).filter(|target| *target != near) {
            Some(target) => {
                Some(self.answer(&scene, target)).filter(|a| a.status == GroundingStatus::Found).unwrap_or(answer)
            }
            None => answer,
        }
    }

    /// As [`ground_with_fronts`](Self::ground_with_fronts), where the thing that is meant is known to be there.
    fn ground_present(&self, scene: Scene<'_>, words: &[String], names: &Names) -> Grounding {
        let (scene, query) = self.understand(scene, words, names);
        let context = Context { scene: &scene, knowledge: &self.knowledge, config: &self.config };
        let (mut evaluation, features) = self.weigh(context, &query, words);
        evaluation.total.fill(0.0);
        for (item, share) in features.items.iter().zip(self.weights.rank(&features)) {
            evaluation.total[*item] = share;
        }
        self.decide(&scene, query, evaluation)
    }

    /// The evidence for each candidate of a text, before it is weighed; for fitting the weights.
    pub fn rank_evidence(&self, map: &Map, fronts: &BTreeMap<ObjectId, [f64; 2]>, text: &str) -> Ranking {
        let tokens = tokens_of(text);
        let words = without_verb(&tokens);
        let scene = Scene::new(map, &self.knowledge, None).with_fronts(fronts);
        let names = Names::of(scene.names.winning(), true);
        let (scene, query) = self.understand(scene, words, &names);
        let context = Context { scene: &scene, knowledge: &self.knowledge, config: &self.config };
        let (_, features) = self.weigh(context, &query, words);
        Ranking {
            ids: features.items.iter().map(|item| scene.items[*item].object.id).collect(),
            rows: features.rows.iter().map(|row| row.to_vec()).collect(),
        }
    }

    /// The query, and the scene as seen from where the words place the viewer.
    fn understand<'a>(&self, scene: Scene<'a>, words: &[String], names: &Names) -> (Scene<'a>, Query) {
        let anything = || Query { target: Entity::named(Noun::Anything), viewpoint: None };
        let query = parse_query(words, &self.knowledge, names, Attachment::Nearest).unwrap_or_else(anything);
        let query = self.with_known_noun(&scene, query, words, names);
        match self.faced(&scene, &query) {
            Some(forward) => (scene.facing(forward), query),
            None => (scene, query),
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

    fn answer(&self, scene: &Scene<'_>, query: Query) -> Grounding {
        let context = Context { scene, knowledge: &self.knowledge, config: &self.config };
        if matches!(query.target.noun, Noun::Room(_)) {
            return self.answer_room(context, query);
        }
        // Stages 1 and 2: retrieval and the relation filter.
        let evaluation = filter::evaluate(context, &query.target);
        self.decide(scene, query, evaluation)
    }

    fn decide(&self, scene: &Scene<'_>, query: Query, evaluation: filter::Evaluation) -> Grounding {
        let mut choices = decide::best_choices(&evaluation, self.config.top_k);
        let all: Vec<usize> = choices.iter().map(|choice| choice.index).collect();
        choices.retain(|choice| !all.iter().any(|other| scene.is_double(choice.index, *other, &self.knowledge)));
        // Stage 3: verification of the top k in views.
        if self.config.verify && self.verifier.wants_views(&query) {
            self.verify(scene, &query, &mut choices);
        }
        let settled = decide::settle(&choices, query.target.article == Article::Indefinite, &self.config, |choice| {
            let (eye, _) = scene.standpoint();
            (scene.items[choice.index].bounds.center().xy() - eye).norm()
        });
        let object_of = |choice: &Choice| (Some(scene.items[choice.index].object.id), None);
        decide::grounding(settled, choices, object_of, evaluation.frame, self.verifier.name(), query)
    }

    fn verify(&self, scene: &Scene<'_>, query: &Query, choices: &mut [Choice]) {
        let mut renderer = Renderer::default();
        let levels = self.verifier.levels();
        let best = choices.first().map_or(0.0, |choice| choice.score);
        let in_reach = |score: f32| score >= self.verifier.least_factor() * best;
        for choice in choices.iter_mut().take(self.config.top_k).filter(|choice| in_reach(choice.score)) {
            let candidate = scene.items[choice.index].object;
            let anchors = choice.anchors.iter().map(|&anchor| scene.items[anchor].object).collect::<Vec<_>>();
            let verdict = match CandidateViews::render_levels(scene.map, candidate, &anchors, levels, &mut renderer) {
                Some(views) => self.verifier.verify(Evidence { query, candidate, anchors: &anchors, views: &views }),
                None => Verdict {
                    factor: 1.0,
                    reason: "in views: the map has no points of it".to_owned(),
                    shown: Vec::new(),
                },
            };
            choice.apply_verdict(verdict);
        }
        decide::sort(choices);
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
        decide::grounding(settled, choices, room_of, frame, self.verifier.name(), query)
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
