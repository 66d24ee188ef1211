//! Grasping until it holds: from one place after the other, and again from where the thing lies when the hand lost it.

use super::Outcome;
use super::fallen::{Lost, find_lost};
use super::grasp::{GraspSettings, GraspTask, NO_PLACE, try_grasp};
use super::held::Standing;
use super::meaning::Meaning;
use super::retreat::retreat;
use super::target::Target;
use crate::agent::{Agent, Halt};
use crate::summary::Stage;
use dsm::map::ObjectId;
use dsm::time::Span;
use dsm_robot::nav::NavConfig;

/// So often a thing that slipped out of the hand is looked for and grasped again.
const MAX_REGRIPS: usize = 2;
/// After so many vain attempts a thing that nobody sees is not there, and the map has it no more after this time.
const MISSED: usize = 2;
const FORGOTTEN_AFTER: Span = Span(1_500_000_000);

/// What a grasp came to.
#[derive(Clone, Debug, PartialEq)]
pub struct Grasped {
    /// How it ended.
    pub outcome: Outcome,
    /// The thing as it stood before the last try; `None` when the map never held it.
    pub standing: Option<Standing>,
}

/// Drives to an object and lifts it. `meaning` is what the words that led to it mean.
pub fn grasp(
    agent: &mut Agent,
    nav: &NavConfig,
    settings: &GraspSettings,
    id: ObjectId,
    meaning: Option<&Meaning>,
) -> Result<Grasped, Halt> {
    match Target::of(agent.map(), id) {
        Some(target) => grasp_until_held(agent, (nav, settings), target, meaning),
        None => Ok(gone(id)),
    }
}

/// As [`grasp`], for an object that stands on something at `support_z_m` which hides its foot.
pub fn grasp_standing_on(
    agent: &mut Agent,
    nav: &NavConfig,
    settings: &GraspSettings,
    id: ObjectId,
    support_z_m: f64,
) -> Result<Grasped, Halt> {
    match Target::standing_on(agent.map(), id, support_z_m) {
        Some(target) => grasp_until_held(agent, (nav, settings), target, None),
        None => Ok(gone(id)),
    }
}

fn gone(id: ObjectId) -> Grasped {
    Grasped { outcome: Outcome::Failed(Stage::Mapping, format!("object {} left the map", id.0)), standing: None }
}

fn grasp_until_held(
    agent: &mut Agent,
    (nav, settings): (&NavConfig, &GraspSettings),
    mut target: Target,
    meaning: Option<&Meaning>,
) -> Result<Grasped, Halt> {
    let mut standing = Standing::of(&target.in_map(agent.map()), target.id());
    let mut last = (Stage::Planning, "no attempt was made".to_owned());
    let mut slipped_z_m = Vec::new();
    let (mut attempt, mut attempts, mut regrips) = (0, 0, 0);
    let mut missed = 0;
    while attempt < settings.max_attempts {
        let began = agent.now();
        let task = GraspTask { nav, settings, target: &target, meaning };
        let (stage, reason) = match try_grasp(agent, &task, attempt, &mut slipped_z_m)? {
            Ok(reason) => return Ok(Grasped { outcome: Outcome::Done(reason), standing }),
            Err(failure) => failure,
        };
        agent.note(format!("grasp attempt {attempts} failed ({stage:?}): {reason}"));
        (attempt, attempts) = (attempt + 1, attempts + 1);
        let ends = match stage {
            // Nothing has moved, and asking again gives the same answer.
            Stage::Planning => reason == NO_PLACE,
            _ => false,
        };
        // The hand was there and did not find it, and no camera saw it meanwhile.
        missed += usize::from(stage == Stage::Grasp);
        let unseen = agent.map().find_object(target.id()).is_some_and(|object| object.last_seen < began);
        let is_missing = missed >= MISSED && unseen;
        let slipped = stage == Stage::Hold && agent.grip_state()?.width_m < settings.min_width_m;
        last = (stage, reason);
        if ends {
            break;
        }
        if slipped && regrips < MAX_REGRIPS {
            regrips += 1;
            if let Some(found) = find_lost(agent, &Lost::of(&target))?
                && let Some(lies) = Target::of(agent.map(), found)
            {
                agent.note(format!("it lies there: object {}; grasps it again", found.0));
                if found != target.id() {
                    attempt = 0;
                }
                standing = Standing::of(agent.map(), found).or(standing);
                target = lies;
                continue;
            }
        } else {
            retreat(agent)?;
        }
        if last.0 == Stage::Grounding {
            break;
        }
        if is_missing {
            agent.note(format!("object {} is not where the map has it", target.id().0));
            agent.missed.push(target.id());
            // Until a frame took it out of the map.
            agent.rest(FORGOTTEN_AFTER)?;
        }
        if agent.map().find_object(target.id()).is_none() {
            // A nearer look made another object of it: that is for whoever knows the words.
            last.0 = Stage::Mapping;
            break;
        }
    }
    let outcome = Outcome::Failed(last.0, format!("{attempts} attempts; the last: {}", last.1));
    Ok(Grasped { outcome, standing })
}
