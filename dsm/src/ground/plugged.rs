//! How the grounder asks plugged-in backends, and what takes over when they fail.

use super::backend::{BackendError, GroundingStage, LEAST_FACTOR, Spoken};
use super::decide::{self, Choice};
use super::founded::find_unfounded;
use super::grounder::Grounder;
use super::query::Query;
use super::reader::QueryText;
use super::scene::Scene;
use super::scorer::RelatedCandidate;
use super::verify::{Evidence, Verdict, Verifier};
use super::views::{CandidateViews, Levels};
use crate::map::{MapObject, RelationKind};
use crate::raster::Renderer;

/// Most stored relations that a scorer is told of one candidate.
const MAX_RELATIONS: usize = 12;

impl Grounder {
    /// The readings of the words, and who read them.
    pub(super) fn read(&self, said: &QueryText<'_>) -> (Vec<Query>, Vec<Spoken>) {
        let Some(reader) = &self.reader else { return (self.embedded_reader.readings(said), Vec::new()) };
        let unfounded = |queries: &[Query]| {
            queries.iter().find_map(|query| find_unfounded(query, said.words, &self.knowledge)).map(|what| {
                let name = reader.name().to_owned();
                BackendError::Unfounded { name, what }
            })
        };
        let read = reader.read(said).and_then(|queries| match unfounded(&queries) {
            Some(error) => Err(error),
            None => Ok(queries),
        });
        match read {
            Ok(queries) => (queries, vec![Spoken::by(GroundingStage::Parse, reader.name())]),
            Err(error) => (self.embedded_reader.readings(said), vec![Spoken::embedded(GroundingStage::Parse, &error)]),
        }
    }

    /// Has the plugged-in scorer look at the relations of the best candidates, where there are several and the words say
    /// where the thing is.
    pub(super) fn score_relations(
        &self,
        scene: &Scene<'_>,
        text: &str,
        query: &Query,
        choices: &mut [Choice],
    ) -> Option<Spoken> {
        let scorer = self.scorer.as_ref().filter(|_| self.config.relation_filter)?;
        let says_where = !query.target.relations.is_empty() || !query.target.selections.is_empty();
        // Who lies farther behind cannot be preferred.
        let reach = LEAST_FACTOR * choices.first().map_or(0.0, |choice| choice.score);
        let in_reach = choices.iter().take_while(|choice| choice.score >= reach).count();
        if !says_where || in_reach < 2 {
            return None;
        }
        let candidates: Vec<RelatedCandidate<'_>> =
            choices[..in_reach].iter().map(|choice| related(scene, choice)).collect();
        let sound = |scores: Vec<f32>| {
            let given = scores.iter().filter(|score| (0.0..=1.0).contains(*score)).count();
            if given == candidates.len() && scores.len() == candidates.len() {
                return Ok(scores);
            }
            Err(BackendError::Scores { name: scorer.name().to_owned(), given, candidates: candidates.len() })
        };
        match scorer.score(text, query, &candidates).and_then(sound) {
            Ok(scores) => {
                for (choice, score) in choices.iter_mut().zip(scores) {
                    choice.apply_factor(format!("relations, by {}", scorer.name()), softened(score));
                }
                decide::sort(choices);
                Some(Spoken::by(GroundingStage::Relations, scorer.name()))
            }
            Err(error) => Some(Spoken::embedded(GroundingStage::Relations, &error)),
        }
    }

    /// Verifies the best candidates in views, by the plugged-in verifier if it answers.
    pub(super) fn verify(
        &self,
        scene: &Scene<'_>,
        text: &str,
        query: &Query,
        choices: &mut [Choice],
    ) -> Option<Spoken> {
        let plugged = self.verifier.as_deref().filter(|verifier| verifier.wants_views(query));
        let mut spoken = None;
        if let Some(verifier) = plugged {
            let looked = look(verifier, self.config.top_k, scene, text, query, choices);
            match looked.and_then(|verdicts| verdicts.map(|v| sound_verdicts(verifier.name(), v)).transpose()) {
                Ok(Some(verdicts)) => {
                    apply(choices, verdicts);
                    return Some(Spoken::by(GroundingStage::Verify, verifier.name()));
                }
                Ok(None) => {}
                Err(error) => spoken = Some(Spoken::embedded(GroundingStage::Verify, &error)),
            }
        }
        let embedded = &self.embedded_verifier;
        if embedded.wants_views(query)
            && let Ok(Some(verdicts)) = look(embedded, self.config.top_k, scene, text, query, choices)
        {
            apply(choices, verdicts);
        }
        spoken
    }
}

/// A plugged-in score as a factor that prefers and never refuses.
fn softened(score: f32) -> f32 {
    LEAST_FACTOR + (1.0 - LEAST_FACTOR) * score
}

/// Verdicts by place in the list of choices.
type Verdicts = Vec<(usize, Verdict)>;

/// Shows the candidates in reach to a verifier; `None` when there are too few for it.
fn look(
    verifier: &dyn Verifier,
    top_k: usize,
    scene: &Scene<'_>,
    text: &str,
    query: &Query,
    choices: &[Choice],
) -> Result<Option<Verdicts>, BackendError> {
    let best = choices.first().map_or(0.0, |choice| choice.score);
    let reach = verifier.least_factor() * best;
    let places: Vec<usize> = (0..choices.len().min(top_k)).filter(|place| choices[*place].score >= reach).collect();
    if places.len() < verifier.least_candidates() {
        return Ok(None);
    }
    let mut renderer = Renderer::default();
    let levels = verifier.levels();
    let seen: Vec<Seen<'_>> = places.iter().map(|place| see(scene, &choices[*place], levels, &mut renderer)).collect();
    let shown: Vec<(usize, &Seen<'_>, &CandidateViews)> =
        places.iter().zip(&seen).filter_map(|(place, seen)| Some((*place, seen, seen.views.as_ref()?))).collect();
    let evidence: Vec<Evidence<'_>> = shown
        .iter()
        .map(|(_, seen, views)| Evidence { text, query, candidate: seen.candidate, anchors: &seen.anchors, views })
        .collect();
    let verdicts = if evidence.is_empty() { Vec::new() } else { verifier.verify(&evidence)? };
    if verdicts.len() != evidence.len() {
        let (name, given) = (verifier.name().to_owned(), verdicts.len());
        return Err(BackendError::Scores { name, given, candidates: evidence.len() });
    }
    let unseen = places.iter().zip(&seen).filter(|(_, seen)| seen.views.is_none());
    let blank =
        || Verdict { factor: 1.0, reason: "in views: the map has no points of it".to_owned(), shown: Vec::new() };
    let blanks = unseen.map(|(place, _)| (*place, blank()));
    Ok(Some(shown.iter().map(|(place, _, _)| *place).zip(verdicts).chain(blanks).collect()))
}

/// A candidate with its views.
struct Seen<'a> {
    candidate: &'a MapObject,
    anchors: Vec<&'a MapObject>,
    views: Option<CandidateViews>,
}

fn see<'a>(scene: &Scene<'a>, choice: &Choice, levels: Levels, renderer: &mut Renderer) -> Seen<'a> {
    let candidate = scene.items[choice.index].object;
    let anchors: Vec<&MapObject> = choice.anchors.iter().map(|&anchor| scene.items[anchor].object).collect();
    let views = CandidateViews::render_levels(scene.map, candidate, &anchors, levels, renderer);
    Seen { candidate, anchors, views }
}

/// What a plugged-in verifier may say: it prefers and never refuses, and it cannot overrule an attribute.
fn sound_verdicts(name: &str, verdicts: Verdicts) -> Result<Verdicts, BackendError> {
    let candidates = verdicts.len();
    let given = verdicts.iter().filter(|(_, verdict)| (0.0..=1.0).contains(&verdict.factor)).count();
    if given < candidates {
        return Err(BackendError::Scores { name: name.to_owned(), given, candidates });
    }
    let soften = |(place, verdict): (usize, Verdict)| {
        (place, Verdict { factor: softened(verdict.factor), shown: Vec::new(), ..verdict })
    };
    Ok(verdicts.into_iter().map(soften).collect())
}

fn apply(choices: &mut [Choice], verdicts: Verdicts) {
    for (place, verdict) in verdicts {
        choices[place].apply_verdict(verdict);
    }
    decide::sort(choices);
}

/// What the map knows of a candidate's place: edges to its anchors first, then the surest.
fn related<'a>(scene: &Scene<'a>, choice: &Choice) -> RelatedCandidate<'a> {
    let object = scene.items[choice.index].object;
    let anchors: Vec<&MapObject> = choice.anchors.iter().map(|&anchor| scene.items[anchor].object).collect();
    let is_anchor = |other: &MapObject| anchors.iter().any(|anchor| anchor.id == other.id);
    let own = scene.map.relations.iter().filter(|relation| relation.from == object.id);
    let mut edges: Vec<(RelationKind, &MapObject, f32)> =
        own.filter_map(|edge| Some((edge.kind, scene.map.find_object(edge.to)?, edge.confidence))).collect();
    edges.sort_by(|a, b| {
        is_anchor(b.1).cmp(&is_anchor(a.1)).then(b.2.total_cmp(&a.2)).then((a.1.id, a.0).cmp(&(b.1.id, b.0)))
    });
    edges.truncate(MAX_RELATIONS);
    let relations = edges.into_iter().map(|(kind, other, _)| (kind, other)).collect();
    RelatedCandidate { object, relations, anchors, score: choice.score.clamp(0.0, 1.0) }
}
