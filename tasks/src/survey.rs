//! Maps against truth: a scene is explored once; its frames are then seen again and mapped under each condition.
//!
//! ```text
//! drive: world, robot, exploration ──▶ moments ──Replay──▶ frames, detections ──pose noise──▶ builders ──▶ maps ──▶ scores
//!                                                   └──▶ TrueScene (only handed to the scores) ─────────────────────┘
//! ```

use crate::agent::{Agent, AgentConfig, Halt, Parts};
use crate::assemble::{Assembled, assemble_recording, knowledge, replay, sees_pixels_alone};
use crate::error::TaskError;
use crate::mapping::{Mapping, Updates};
use crate::perception::Perception;
use crate::run::{CELL_M, RunSpec};
use crate::session::nav_config;
use crate::skills::explore::{Explorer, Interest};
use dsm::build::{BuildConfig, Carrier, MapBuilder};
use dsm::eval::{MapScore, TrueScene, score_map};
use dsm::geometry::OrientedBox;
use dsm::map::Map;
use dsm::perceive::{Detector, PixelSegmenter};
use dsm::time::Stamp;
use dsm_sim::replay::{MaskScore, Moment, PoseWander, Replay, Shown};
use nalgebra::Point2;
use rayon::prelude::*;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::sync::mpsc::channel;

/// One way to map the frames of a drive.
#[derive(Clone, Debug, PartialEq)]
pub struct Condition {
    /// Deviation of the camera's believed position along each axis, metres; attitude goes with it, 0.2 degrees per
    /// centimetre.
    pub pose_noise_m: f64,
    /// How maps are built.
    pub build: BuildConfig,
}

/// Explores the scene of `spec` within its time limit and gives what is needed to see every frame again.
pub fn drive(spec: &RunSpec, interrupted: Arc<AtomicBool>) -> Result<Vec<Moment>, TaskError> {
    let (sender, moments) = channel();
    let Assembled { robot, model, detector, truth, .. } = assemble_recording(spec, Some(sender))?;
    let config = AgentConfig::default();
    let map = Map::new(CELL_M);
    let builder = MapBuilder::new(BuildConfig::default(), knowledge()?);
    let perception = Perception::start(detector, builder, map.clone(), Vec::new(), config.mapping_latency);
    // Nobody judges this run.
    drop(truth);
    let deadline = Stamp::from_s(spec.time_limit_s);
    let on_tick = Box::new(|_| {});
    let parts = Parts {
        robot,
        model: model.clone(),
        perception,
        map,
        deadline,
        interrupted,
        on_tick,
        on_frame: Box::new(|_| {}),
    };
    let mut agent = Agent::new(parts, config);
    let interest = Interest { enough: &mut |_| false, inspect: &|_| Vec::new() };
    let explored = Explorer::new(nav_config(&model)).run(&mut agent, deadline, interest);
    agent.finish()?;
    match explored {
        Err(Halt::Failed(error)) => Err(error),
        Err(Halt::Stopped(error)) => Err(TaskError::Internal(format!("the drive through the scene stopped: {error}"))),
        Ok(_) | Err(Halt::TimeUp | Halt::Interrupted) => Ok(moments.iter().collect()),
    }
}

/// One map under construction.
struct Trial<'a> {
    condition: &'a Condition,
    mapping: Mapping,
}

impl Trial<'_> {
    fn observe(&mut self, shown: &Shown, wander: &PoseWander, radius_m: f64) {
        let error = wander.error(self.condition.pose_noise_m, &shown.frame.world_from_camera);
        let mut frame = shown.frame.clone();
        frame.world_from_camera = error * frame.world_from_camera;
        let body = |b: &OrientedBox| OrientedBox {
            center: error * b.center,
            size: b.size,
            rotation: error.rotation * b.rotation,
        };
        let base = error * shown.world_from_base;
        let carrier = Carrier {
            bodies: shown.robot.iter().map(body).collect(),
            footprint: Some((Point2::from(base.translation.vector.xy()), radius_m)),
            moved: Vec::new(),
            swept: Vec::new(),
            missed: Vec::new(),
        };
        self.mapping.observe(&frame, &shown.detections, &carrier);
    }
}

/// Maps the frames of a drive under every condition and scores the maps, in the order of the conditions.
pub fn score_drive(spec: &RunSpec, moments: &[Moment], conditions: &[Condition]) -> Result<Vec<MapScore>, TaskError> {
    let knowledge = knowledge()?;
    let (maps, truth, masks) = map_and_count(spec, moments, conditions)?;
    let pairs: Vec<(Map, &Condition)> = maps.into_iter().zip(conditions).collect();
    let score = |(map, condition): &(Map, &Condition)| {
        let mut score = score_map(map, &truth, &condition.build, &knowledge);
        if let Some(masks) = masks {
            score.shares.insert("mask_recall".into(), masks.recall);
            score.shares.insert("mask_precision".into(), masks.precision);
        }
        score
    };
    Ok(pairs.par_iter().map(score).collect())
}

/// A drive that is seen again, by the simulated detector or by one that sees pixels alone.
struct Watcher {
    replay: Replay,
    pixels: Option<(Box<dyn Detector>, MaskScore)>,
}

impl Watcher {
    fn show(&mut self, moment: &Moment) -> Shown {
        let mut shown = self.replay.show(moment);
        if let Some((detector, masks)) = &mut self.pixels {
            shown.detections = detector.detect(&shown.frame);
            self.replay.count_masks(&shown.detections, masks);
        }
        shown
    }
}

/// Maps the frames of a drive under every condition, in their order; with the truth, which is only for judging.
pub fn map_drive(
    spec: &RunSpec,
    moments: &[Moment],
    conditions: &[Condition],
) -> Result<(Vec<Map>, TrueScene), TaskError> {
    map_and_count(spec, moments, conditions).map(|(maps, truth, _)| (maps, truth))
}

/// As [`map_drive`]; for things found in pixels alone also how well their masks show them.
fn map_and_count(
    spec: &RunSpec,
    moments: &[Moment],
    conditions: &[Condition],
) -> Result<(Vec<Map>, TrueScene, Option<MaskScore>), TaskError> {
    // Nobody waits here: a detector of a backend is asked about every frame.
    let detector = match spec.language.looks()? {
        Some(looks) => Some(looks.detector),
        None => sees_pixels_alone(spec).then(|| Box::new(PixelSegmenter) as Box<dyn Detector>),
    };
    let pixels = detector.map(|detector| (detector, MaskScore::default()));
    let mut watcher = Watcher { replay: replay(spec)?, pixels };
    let radius_m = watcher.replay.robot().settings.base.footprint_radius_m;
    let mut trials: Vec<Trial<'_>> = Vec::with_capacity(conditions.len());
    for condition in conditions {
        let builder = spec.language.builder(condition.build.clone())?;
        let mapping = Mapping::new(builder, spec.language.annotator(), Map::new(CELL_M), Updates::Dropped);
        trials.push(Trial { condition, mapping });
    }
    let mut wander = PoseWander::new(spec.seed);
    let mut next = moments.first().map(|moment| watcher.show(moment));
    for (index, moment) in moments.iter().enumerate() {
        let Some(shown) = next.take() else { break };
        wander.advance(moment.stamp);
        // The next frame is drawn while this one is mapped.
        let map = || trials.par_iter_mut().for_each(|trial| trial.observe(&shown, &wander, radius_m));
        next = rayon::join(|| moments.get(index + 1).map(|later| watcher.show(later)), map).0;
    }
    trials.iter_mut().for_each(|trial| {
        trial.mapping.finish();
    });
    let maps = trials.into_iter().map(|trial| trial.mapping.map).collect();
    Ok((maps, watcher.replay.finish(), watcher.pixels.map(|(_, masks)| masks)))
}
