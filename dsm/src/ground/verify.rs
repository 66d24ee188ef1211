//! Stage 3, multi-level verification: the last look at the few best candidates.

use super::backend::BackendError;
use super::color;
use super::query::{AttributeWord, Query};
use super::views::{CandidateViews, Levels};
use crate::knowledge::Knowledge;
use crate::map::MapObject;
use std::sync::Arc;

/// Name of the backends that need no model.
pub(super) const EMBEDDED: &str = "embedded";

/// Share of the pixels that look like a colour, 0 to 1; `None` for too few pixels.
pub fn find_color_share(knowledge: &Knowledge, asked: &str, pixels: impl Iterator<Item = [u8; 3]>) -> Option<f32> {
    let prototypes = color::Prototypes::of(knowledge.words());
    let (mut fitting, mut all) = (0_usize, 0_usize);
    for pixel in pixels {
        all += 1;
        fitting += usize::from(prototypes.fit(asked, pixel.map(f64::from)) > PIXEL_FIT);
    }
    (all >= SEEN_PIXELS).then(|| fitting as f32 / all as f32)
}

/// What a verifier says of one candidate.
#[derive(Clone, Debug, PartialEq)]
pub struct Verdict {
    /// Multiplies the candidate's score: 1 confirms, less doubts. Range 0 to 1.
    pub factor: f32,
    /// What was seen, in words.
    pub reason: String,
    /// Attribute words of the target that the views show, whatever the map's votes say. Of a plugged-in verifier they do
    /// not count: it can doubt what the map finds, not overrule it.
    pub shown: Vec<String>,
}

/// All that a verifier gets: the pictures, the profile and the query.
#[derive(Clone, Copy)]
pub struct Evidence<'a> {
    /// What was asked, as it was said.
    pub text: &'a str,
    /// What was understood.
    pub query: &'a Query,
    /// The candidate with its attributes.
    pub candidate: &'a MapObject,
    /// The objects that were chosen as anchors of its relations.
    pub anchors: &'a [&'a MapObject],
    /// Its views.
    pub views: &'a CandidateViews,
}

/// Looks at candidates and says whether they fit the query.
pub trait Verifier: Send + Sync {
    /// Name for reports.
    fn name(&self) -> &str;

    /// Whether views would tell anything about this query; if not, none are rendered.
    fn wants_views(&self, query: &Query) -> bool;

    /// The views that it looks at. Default: all.
    fn levels(&self) -> Levels {
        Levels::All
    }

    /// The least factor that it ever gives: candidates so far behind that this could not change their place are not
    /// looked at. Range 0 to 1, default 0.
    fn least_factor(&self) -> f32 {
        0.0
    }

    /// Least number of candidates that are worth a look. Default 1.
    fn least_candidates(&self) -> usize {
        1
    }

    /// Judges the candidates, one verdict each, in their order.
    ///
    /// # Errors
    /// [`BackendError::Backend`] when a plugged-in backend gives no answer; the embedded verifier then looks instead.
    fn verify(&self, candidates: &[Evidence<'_>]) -> Result<Vec<Verdict>, BackendError>;
}

/// Checks colours and visibility in the views, without a model.
///
/// Object level: the share of the candidate's visible pixels that look like the asked colour. Place level: whether the
/// candidate and its anchors are seen together. It doubts, but alone it never refuses: the views show the map's noisy
/// points, and the same points voted for the colour.
#[derive(Clone, Debug)]
pub struct EmbeddedVerifier {
    knowledge: Arc<Knowledge>,
}

/// Share of pixels in the asked colour from which on the colour counts as seen.
const COLOR_SEEN_SHARE: f32 = 0.35;
/// A pixel looks like a colour when it fits it this well, relative to the best-fitting colour.
const PIXEL_FIT: f32 = 0.6;
/// Fit from which the views show an attribute.
const SHOWN: f32 = 0.9;
/// What remains of a candidate's score when a level speaks against it.
const DOUBT: f32 = 0.7;
/// What remains at least.
const LEAST: f32 = 0.4;
/// Pixels from which on something counts as seen.
const SEEN_PIXELS: usize = 8;

impl EmbeddedVerifier {
    /// A verifier that knows colour words from `knowledge`.
    pub fn new(knowledge: Arc<Knowledge>) -> Self {
        Self { knowledge }
    }

    /// Share of the candidate's pixels that look like the colour; `None` when it is not seen.
    fn color_share(&self, views: &CandidateViews, asked: &str) -> Option<f32> {
        let own = views.object.labels.iter().zip(&views.object.color).filter(|(label, _)| **label == 1);
        find_color_share(&self.knowledge, asked, own.map(|(_, pixel)| *pixel))
    }

    /// Judges one candidate.
    pub(super) fn judge(&self, evidence: Evidence<'_>) -> Verdict {
        let Evidence { query, anchors, views, .. } = evidence;
        let mut factor = 1.0;
        let (mut seen, mut shown) = (Vec::new(), Vec::new());
        for term in query.target.attributes.iter().filter(|term| term.kind == AttributeWord::Color) {
            let Some(share) = self.color_share(views, &term.word) else { continue };
            let fits = (share / COLOR_SEEN_SHARE).min(1.0);
            if fits >= SHOWN && !term.negated {
                shown.push(term.word.clone());
            }
            let fits = if term.negated { 1.0 - fits } else { fits };
            factor *= DOUBT + (1.0 - DOUBT) * fits;
            seen.push(format!("{:.0} % of its pixels look {}", 100.0 * share, term.word));
        }
        let with_points = anchors.iter().filter(|anchor| !anchor.points.is_empty());
        for anchor in with_points {
            let together = views.pixel_count(&views.place, anchor.id) >= SEEN_PIXELS;
            factor *= if together { 1.0 } else { 0.5 * (1.0 + DOUBT) };
            seen.push(format!("the {} is {} with it", anchor.name(), if together { "seen" } else { "not seen" }));
        }
        if seen.is_empty() {
            seen.push("the views tell nothing".to_owned());
        }
        Verdict { factor: factor.max(LEAST), reason: format!("in views: {}", seen.join(", ")), shown }
    }
}

impl Verifier for EmbeddedVerifier {
    fn name(&self) -> &str {
        EMBEDDED
    }

    fn wants_views(&self, query: &Query) -> bool {
        let colored = query.target.attributes.iter().any(|term| term.kind == AttributeWord::Color);
        colored || !query.target.relations.is_empty()
    }

    fn levels(&self) -> Levels {
        Levels::Near
    }

    fn least_factor(&self) -> f32 {
        LEAST
    }

    fn verify(&self, candidates: &[Evidence<'_>]) -> Result<Vec<Verdict>, BackendError> {
        Ok(candidates.iter().map(|evidence| self.judge(*evidence)).collect())
    }
}
