//! The loop of grounding.

use super::answer::{Grounding, ReferenceFrame};
use super::command::without_verb;
use super::config::{GroundConfig, GroundConfigError};
use super::decide::{self, Choice};
use super::filter::{self, Context};
use super::noun::Names;
use super::parse::{Attachment, parse_query};
use super::query::{Noun, Query};
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
use std::collections::BTreeMap;
use std::sync::Arc;

/// Grounds referring expressions in a map.
pub struct Grounder {
    config: GroundConfig,
    knowledge: Arc<Knowledge>,
    verifier: Box<dyn Verifier>,
}

impl Grounder {
    /// A grounder with the embedded verifier.
    ///
    /// # Errors
    /// A parameter outside its range.
    pub fn new(config: GroundConfig, knowledge: Arc<Knowledge>) -> Result<Self, GroundConfigError> {
        config.validate()?;
        let verifier = Box::new(EmbeddedVerifier::new(Arc::clone(&knowledge)));
        Ok(Self { config, knowledge, verifier })
    }

    /// Replaces the verifier, for example by one that asks a vision-language model.
    pub fn with_verifier(mut self, verifier: Box<dyn Verifier>) -> Self {
        self.verifier = verifier;
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
        let names = Names::of(map);
        let Some(near) = parse_query(words, &self.knowledge, &names, Attachment::Nearest) else {
            let reason = if tokens.is_empty() { "there are no words" } else { "no thing or room is named" };
            return Grounding::unparsed(reason, self.verifier.name());
        };
        let scene = Scene::new(map, world_from_viewer).with_fronts(fronts);
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

    fn answer(&self, scene: &Scene<'_>, query: Query) -> Grounding {
        let context = Context { scene, knowledge: &self.knowledge, config: &self.config };
        if matches!(query.target.noun, Noun::Room(_)) {
            return self.answer_room(context, query);
        }
        // Stages 1 and 2: retrieval and the relation filter.
        let evaluation = filter::evaluate(context, &query.target);
        let mut choices = decide::best_choices(&evaluation, self.config.top_k);
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
        for choice in choices.iter_mut().take(self.config.top_k) {
            let candidate = scene.items[choice.index].object;
            let anchors = choice.anchors.iter().map(|&anchor| scene.items[anchor].object).collect::<Vec<_>>();
            let verdict = match CandidateViews::render(scene.map, candidate, &anchors, &mut renderer) {
                Some(views) => self.verifier.verify(Evidence { query, candidate, anchors: &anchors, views: &views }),
                None => Verdict { factor: 1.0, reason: "in views: the map has no points of it".to_owned() },
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
