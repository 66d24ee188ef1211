//! Search: explore until the words point at one thing, or until all has been seen.

use super::explore::{ExploreOutcome, Explorer, Interest};
use crate::agent::{Agent, Halt};
use dsm::ground::{Grounder, Grounding, GroundingStatus};
use dsm::knowledge::Knowledge;
use dsm::map::{AttributeKind, Map, MapObject, ObjectId};
use dsm::time::{Span, Stamp};
use std::sync::Arc;

/// Exploration stops early only for a grounding that scores at least this.
const SURE_SCORE: f32 = 0.5;
/// ... and that has pointed at the same thing for this long.
const SURE_FOR: Span = Span(3_000_000_000);
/// Words are grounded this often while exploring.
const GROUND_EVERY: Span = Span(1_000_000_000);

/// Grounds `text`, exploring as long as the answer is not sure and something is left to see before `end`.
pub fn search(
    agent: &mut Agent,
    explorer: &mut Explorer,
    grounder: &Arc<Grounder>,
    knowledge: &Knowledge,
    text: &str,
    end: Stamp,
) -> Result<Grounding, Halt> {
    let mut grounded_at = Stamp(i64::MIN / 2);
    let mut same_since: Option<(Stamp, Option<u64>, Option<u32>)> = None;
    let mut enough = |map: &Arc<Map>| {
        if map.stamp - grounded_at < GROUND_EVERY {
            return false;
        }
        grounded_at = map.stamp;
        let grounding = grounder.ground(map, text, None);
        if grounding.status == GroundingStatus::Unparsed {
            return true;
        }
        // A room is only known when the flat is.
        if grounding.status != GroundingStatus::Found || grounding.score < SURE_SCORE || grounding.room_id.is_some() {
            same_since = None;
            return false;
        }
        let target = (grounding.object_id.map(|id| id.0), grounding.room_id.map(|id| id.0));
        match same_since {
            Some((since, object, room)) if (object, room) == target => map.stamp - since >= SURE_FOR,
            _ => {
                same_since = Some((map.stamp, target.0, target.1));
                false
            }
        }
    };
    let named = named_in(knowledge, text);
    let inspect = |map: &Map| named.find_in(map);
    let outcome = explorer.run(agent, end, Interest { enough: &mut enough, inspect: &inspect })?;
    let now_s = agent.now().as_s();
    if outcome != ExploreOutcome::Enough {
        agent.journal.note(now_s, format!("exploration ends: {outcome:?}"), None);
    }
    let viewer = agent.world_from_base()?;
    let (map, grounder, text) = (agent.map().clone(), grounder.clone(), text.to_owned());
    agent.plan(move || grounder.ground(&map, &text, Some(&viewer)))
}

/// Categories and colours that a sentence mentions.
struct Named {
    categories: Vec<String>,
    colors: Vec<String>,
}

/// Where a sentence says that something is, it is worth to look from near: a small thing on a white shelf is only found
/// by looking at white shelves.
fn named_in(knowledge: &Knowledge, text: &str) -> Named {
    let words: Vec<String> =
        text.split(|c: char| !c.is_alphanumeric()).filter(|w| !w.is_empty()).map(str::to_lowercase).collect();
    let pairs = words.windows(2).map(|pair| pair.join(" "));
    let category = |word: String| knowledge.find_exact(&word).map(|category| category.name.clone());
    let categories = pairs.chain(words.iter().cloned()).filter_map(category).collect();
    let colors = &knowledge.words().colors;
    let colors = words.iter().filter_map(|word| colors.find(word)).map(str::to_owned).collect();
    Named { categories, colors }
}

impl Named {
    /// Objects of the map with a name of the sentence, and one of its colours if it has any.
    fn find_in(&self, map: &Map) -> Vec<ObjectId> {
        let fits = |object: &&MapObject| {
            let color = object.attributes.find(AttributeKind::Appearance, "color").unwrap_or("");
            self.categories.iter().any(|category| category == object.name())
                && (self.colors.is_empty() || self.colors.iter().any(|c| c == color))
        };
        map.stable_objects().filter(fits).map(|object| object.id).collect()
    }
}
