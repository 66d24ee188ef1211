//! What acts in a run, put together the same way whatever stands behind the robot: a world, hardware or a recording.

use crate::agent::{Agent, AgentConfig, OnFrame, Parts};
use crate::assemble::knowledge;
use crate::deferred::Waiting;
use crate::error::TaskError;
use crate::executor::Executor;
use crate::language::{self, Language, Looks};
use crate::late_sight::{LateSight, Moment, Pace};
use crate::perception::{Perception, Sight, Tape};
use crate::run::CELL_M;
use crate::session::nav_config;
use crate::skills::grasp::GraspSettings;
use dsm::build::BuildConfig;
use dsm::ground::GroundConfig;
use dsm::map::Map;
use dsm::perceive::Detector;
use dsm::time::{Span, Stamp};
use dsm_robot::drivers::Robot;
use dsm_robot::model::RobotModel;
use dsm_robot::nav::NavConfig;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// Who acts.
pub(crate) struct Crew {
    /// The robot with its senses and its map.
    pub(crate) agent: Agent,
    /// From commands to skills.
    pub(crate) executor: Executor,
    /// How the robot may drive.
    pub(crate) nav: NavConfig,
}

/// What it is put together from.
pub(crate) struct Gear {
    /// The robot with its limits.
    pub(crate) robot: Box<dyn Robot>,
    /// Its model.
    pub(crate) model: Arc<RobotModel>,
    /// The detector, where the backend has none of its own.
    pub(crate) detector: Box<dyn Detector>,
    /// Who reads words, verifies candidates and describes frames.
    pub(crate) language: Arc<dyn Language>,
    /// Whether time waits for slow work.
    pub(crate) waiting: Waiting,
    /// Keep what the map is made of.
    pub(crate) tapes: Vec<Box<dyn Tape>>,
    /// When the run ends, simulated seconds.
    pub(crate) time_limit_s: f64,
    /// Set by Ctrl-C.
    pub(crate) interrupted: Arc<AtomicBool>,
    /// Called once a tick, after time has passed.
    pub(crate) on_tick: Box<dyn FnMut(Stamp)>,
    /// Called with each frame, before it is learned from.
    pub(crate) on_frame: OnFrame,
}

impl Crew {
    /// Puts a crew together, with an empty map.
    pub(crate) fn new(gear: Gear) -> Result<Self, TaskError> {
        let Gear { robot, model, detector, language, waiting, tapes, time_limit_s, interrupted, on_tick, on_frame } =
            gear;
        let knowledge = knowledge()?;
        let config = AgentConfig { waiting, ..AgentConfig::default() };
        let map = Map::new(CELL_M);
        let builder = language.builder(BuildConfig::default())?;
        let (annotator, latency) = (language.annotator(), config.mapping_latency);
        let sight = match language.looks()? {
            Some(Looks { detector, pace }) => {
                // Hardware does not wait, whatever the file of models says.
                let moment = if waiting == Waiting::Never { Moment::WhenReady } else { pace.moment };
                Sight::Late(LateSight::start(detector, Pace { moment, ..pace }))
            }
            None => Sight::Prompt(detector),
        };
        let perception =
            Perception::start_annotated(sight, builder, annotator, map.clone(), tapes, latency).waiting(waiting);
        let grounder = Arc::new(language::grounder(&*language, GroundConfig::default())?);
        let nav = nav_config(&model);
        let grasping = GraspSettings::for_robot(&model);
        let deadline = Stamp::from_s(time_limit_s);
        let parts = Parts { robot, model, perception, map, deadline, interrupted, on_tick, on_frame };
        let agent = Agent::new(parts, config);
        let executor = Executor::new(nav.clone(), grasping, grounder, knowledge);
        Ok(Self { agent, executor, nav })
    }
}

/// Two seconds at rest, so that what is held is seen to be held.
pub(crate) fn settle(agent: &mut Agent) {
    // A time limit during these seconds changes nothing that is judged.
    let _ = agent.rest(Span::from_s(2.2));
}
