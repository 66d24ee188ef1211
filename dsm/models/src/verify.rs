//! The last look at the few best candidates: pred = VLM(I, O_filtered, Q).

use crate::bounded::remark_of;
use crate::client::Client;
use crate::marks::draw_mark;
use crate::picture::{Canvas, Picture};
use crate::question::Question;
use crate::schema::schema_of;
use crate::score::{in_order, place_of};
use crate::settings::Use;
use crate::unanswered;
use dsm::eval::describe;
use dsm::ground::{BackendError, Evidence, LEAST_FACTOR, Query, Verdict, Verifier};
use dsm::perceive::Mask;
use dsm::raster::Image;
use schemars::JsonSchema;
use serde::Deserialize;
use serde_json::{Value, json};
use std::sync::Arc;

/// Longest reason that is kept, characters.
const MAX_REASON: usize = 120;

/// Verifies candidates by a vision-language model, all in one question.
pub struct LanguageVerifier {
    client: Arc<Client>,
}

#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct Fits {
    /// One entry for each candidate.
    fits: Vec<Fit>,
}

#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct Fit {
    /// The candidate.
    id: u64,
    /// From 0, cannot be meant, to 1, is meant.
    fit: f32,
    /// Why, in a few words.
    reason: String,
}

impl LanguageVerifier {
    /// A verifier that asks `client`.
    pub fn new(client: Arc<Client>) -> Self {
        Self { client }
    }

    fn question(candidates: &[Evidence<'_>], ids: &[u64]) -> Question {
        let mut pictures: Vec<Picture> = Vec::new();
        let mut listed: Vec<Value> = Vec::new();
        for evidence in candidates {
            let first = pictures.len() + 1;
            pictures.extend(pictures_of(evidence));
            let mut value = place_of(evidence.candidate);
            value["profile"] = json!(describe(evidence.candidate));
            value["anchors"] = evidence.anchors.iter().map(|anchor| place_of(anchor)).collect();
            value["pictures"] = (first..=pictures.len()).collect();
            listed.push(value);
        }
        let text = candidates.first().map_or("", |evidence| evidence.text);
        let data = json!({"text": text, "candidates": listed});
        let schema = schema_of::<Fits>(&[("id", ids.iter().map(|id| json!(id)).collect())]);
        Question { pictures, ..Question::of_words(Use::Verify, include_str!("prompts/verify.txt"), data, schema) }
    }
}

impl Verifier for LanguageVerifier {
    fn name(&self) -> &str {
        self.client.name()
    }

    fn wants_views(&self, _: &Query) -> bool {
        true
    }

    fn least_factor(&self) -> f32 {
        LEAST_FACTOR
    }

    /// Where there is one candidate there is nothing to choose.
    fn least_candidates(&self) -> usize {
        2
    }

    fn verify(&self, candidates: &[Evidence<'_>]) -> Result<Vec<Verdict>, BackendError> {
        let ids: Vec<u64> = candidates.iter().map(|evidence| evidence.candidate.id.0).collect();
        let question = Self::question(candidates, &ids);
        let fits = self.client.ask(&question, |Fits { fits }| {
            let numbers = in_order(&ids, fits.iter().map(|fit| (fit.id, fit.fit)))?;
            let reason = |id: &u64| fits.iter().find(|fit| fit.id == *id).map_or("", |fit| fit.reason.as_str());
            let verdict = |(id, fit): (&u64, f32)| Verdict {
                factor: fit,
                reason: format!("in views, by {}: {}", self.client.name(), remark_of(reason(id), MAX_REASON)),
                shown: Vec::new(),
            };
            Ok(ids.iter().zip(numbers).map(verdict).collect())
        });
        fits.map_err(|error| unanswered(&self.client, error))
    }
}

/// Object, place and scene level; the candidate is marked where other things are seen, too.
fn pictures_of(evidence: &Evidence<'_>) -> impl Iterator<Item = Picture> {
    let number = evidence.candidate.id.0.min(u64::from(u32::MAX)) as u32;
    let views = evidence.views;
    let marked = move |view: &Image| {
        let mut canvas = Canvas::of_view(view);
        draw_mark(&mut canvas, &own_pixels(view), number);
        canvas.encode()
    };
    [Canvas::of_view(&views.object).encode(), marked(&views.place), marked(&views.scene)].into_iter().flatten()
}

/// The candidate bears the first label in its views.
fn own_pixels(view: &Image) -> Mask {
    let own = view.labels.iter().zip(0_u32..).filter(|(label, _)| **label == 1).map(|(_, pixel)| pixel);
    Mask::from_sorted_pixels(view.width, own)
}
